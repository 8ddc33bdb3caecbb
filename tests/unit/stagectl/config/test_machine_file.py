"""Reading machine files."""

from __future__ import annotations

from pathlib import Path

import pytest

from stagectl.config import load_machine
from stagectl.errors import ConfigError

GOOD = load_machine().text


def test_text_and_source_are_kept_as_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_bytes(GOOD.replace("\n", "\r\n").encode())
    machine = load_machine(path)
    assert machine.text == GOOD.replace("\n", "\r\n")
    assert machine.source == str(path)


@pytest.mark.parametrize("text", ["[]", "just text", "3", "machine: a"])
def test_a_file_without_a_machine_is_refused_at_its_beginning(problems_of, text: str) -> None:
    assert all(line.startswith("m.yaml:1:1: ") for line in problems_of(text))


def test_a_missing_file_a_directory_and_an_empty_file_are_refused(tmp_path: Path) -> None:
    empty = tmp_path / "empty.yaml"
    empty.touch()
    for path, reason in {
        tmp_path / "no.yaml": ": no such file",
        tmp_path: ": is a directory, not a file",
        empty: ":1:1: is empty",
    }.items():
        with pytest.raises(ConfigError) as caught:
            load_machine(path)
        assert caught.value.problems == (f"{path}{reason}",)
