"""Machine files with one thing wrong, and faults files."""

import pytest

from stagectl.config import load_machine, parse_machine, stage_settings
from stagectl.config.faults import parse_faults
from stagectl.errors import ConfigError
from tests.unit.stagectl.changed_text import changed_text

ADDED = dict.fromkeys(("homing", "effects"), "node: 1\n    ")
OF_DRIVE = ("options", "quirks", "enable_timeout", "boot_timeout", "revision")
ADDED |= dict.fromkeys(OF_DRIVE, "rated_force: 40.0\n      ")
ADDED |= {"realtime": "sync_period: 0.001\n  "}
"""Keys of axis x, its drive and the bus -> what stands before them."""


def problems(text):
    with pytest.raises(ConfigError) as caught:
        stage_settings(parse_machine(text, "m.yaml"))
    assert all("\n" not in line for line in caught.value.problems)
    assert str(caught.value) == "\n".join(caught.value.problems)
    assert caught.value.exit_code == 2
    return caught.value.problems


@pytest.fixture(scope="session")
def problems_of():
    """The problems of a machine file's text, which must have some."""
    return problems


@pytest.fixture(scope="session")
def check_refused():
    """Change a key of the packaged machine, the first of its name (that of axis x): one problem.

    `new` is the key with another value, and perhaps further keys, as `changed_text` has it; what
    the packaged machine leaves out is added (`ADDED`). A key that begins with a dot is of axis x.
    """

    def check(new, key_and_reason):
        above = ADDED.get(new.partition(":")[0], "")
        text, place = changed_text(load_machine().text, above + new)
        (found,) = problems(text)
        if key_and_reason.startswith("."):
            key_and_reason = f"axes.x{key_and_reason}"
        if place:
            assert found.startswith(f"m.yaml:{place}: {key_and_reason}")
        else:
            assert key_and_reason in found

    return check


@pytest.fixture
def parse(machine):
    """The faults of these lines of a faults file."""

    def one(*lines, seed=3):
        text = "faults:\n" + "".join(f"  - {{{line}}}\n" for line in lines)
        return parse_faults(text, "faults.yaml", machine, seed).faults

    return one
