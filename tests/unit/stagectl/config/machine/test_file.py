"""Reading machine files."""

from __future__ import annotations

from pathlib import Path

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.config.faults import load_faults

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


def test_files_may_be_named_by_text(tmp_path):
    (tmp_path / "m.yaml").write_text(load_machine().text)
    machine = load_machine(str(tmp_path / "m.yaml"))
    assert machine == load_machine(tmp_path / "m.yaml")
    path = tmp_path / "f.yaml"
    path.write_text("faults: [{fault: drop, frame: tpdo1, axis: x, probability: 0.002}]\n")
    assert load_faults(str(path), machine, 1) == load_faults(path, machine, 1)


@pytest.mark.parametrize(
    "line",
    [
        "history: postgresql://lab:s3cret@db/stage",
        "history: 'postgresql://lab:s3cret@db/stage'  # of the lab",
        "history: >-\n  postgresql://lab:s3cret@db/stage",
    ],
)
def test_a_password_of_the_history_stays_out_of_the_text_that_is_passed_on(line: str) -> None:
    before, after = "# µm\n", "\n# the rest stays as written\n"
    text = before + line + after + load_machine().text
    machine = parse_machine(text, "machine.yaml")
    assert machine.history == "postgresql://lab:s3cret@db/stage"
    assert "s3cret" not in machine.text
    assert machine.text.startswith(before + 'history: "postgresql://lab@db/stage"')
    assert machine.text.endswith(after + load_machine().text)
    assert "s3cret" not in str(machine.document.data)
    assert parse_machine(machine.text, "recording").history == "postgresql://lab@db/stage"


def test_an_address_without_a_password_is_left_as_written() -> None:
    text = "history: postgresql://lab@db/stage\n" + load_machine().text
    assert parse_machine(text, "machine.yaml").text == text
