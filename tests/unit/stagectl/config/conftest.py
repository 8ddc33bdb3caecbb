"""Machine files with one thing wrong, and faults files."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.config.faults import parse_faults
from stagectl.errors import ConfigError


def problems(text: str) -> tuple[str, ...]:
    with pytest.raises(ConfigError) as caught:
        parse_machine(text, "m.yaml")
    assert all("\n" not in line for line in caught.value.problems)
    assert str(caught.value) == "\n".join(caught.value.problems)
    assert caught.value.exit_code == 2
    return caught.value.problems


@pytest.fixture(scope="session")
def problems_of() -> Callable[[str], tuple[str, ...]]:
    """The problems of a machine file's text, which must have some."""
    return problems


@pytest.fixture(scope="session")
def check_refused() -> Callable[[str, str, str], None]:
    """Replace the first `old` in the packaged machine (that of axis x) by `new`: one problem.

    `^` in the new text marks the place that the problem must name.
    """

    def check(old: str, new: str, key_and_reason: str) -> None:
        good = load_machine().text
        assert old in good
        text = good.replace(old, new, 1)
        (found,) = problems(text.replace("^", ""))
        if "^" in text:
            before = text[: text.index("^")]
            place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
            assert found.startswith(f"m.yaml:{place}: {key_and_reason}")
        else:
            assert key_and_reason in found

    return check


@pytest.fixture(scope="module")
def machine():
    """The packaged machine."""
    return load_machine()


@pytest.fixture
def parse(machine):
    """The faults of these lines of a faults file."""

    def one(*lines, seed=3):
        text = "faults:\n" + "".join(f"  - {{{line}}}\n" for line in lines)
        return parse_faults(text, "faults.yaml", machine, seed).faults

    return one
