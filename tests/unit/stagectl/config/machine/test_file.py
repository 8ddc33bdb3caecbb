"""Reading machine files."""

import pytest

from stagectl.config import load_machine, parse_machine

GOOD = load_machine().text


def test_text_and_source_are_kept_as_read(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_bytes(GOOD.replace("\n", "\r\n").encode())
    machine = load_machine(path)
    assert (machine.text, machine.source) == (GOOD.replace("\n", "\r\n"), str(path))
    assert load_machine(str(path)) == machine


@pytest.mark.parametrize("text", ["[]", "just text", "3", "machine: a"])
def test_a_file_without_a_machine_is_refused_at_its_beginning(problems_of, text):
    assert all(line.startswith("m.yaml:1:1: ") for line in problems_of(text))


@pytest.mark.parametrize(
    "line",
    [
        "history: postgresql://lab:s3cret@db/stage",
        "history: 'postgresql://lab:s3cret@db/stage'  # of the lab",
        "history: >-\n  postgresql://lab:s3cret@db/stage",
    ],
)
def test_a_password_of_the_history_stays_out_of_the_text_that_is_passed_on(line):
    before, after = "# µm\n", "\n# the rest stays as written\n"
    text = before + line + after + load_machine().text
    machine = parse_machine(text, "machine.yaml")
    assert machine.history == "postgresql://lab:s3cret@db/stage"
    assert "s3cret" not in machine.text
    assert machine.text.startswith(before + 'history: "postgresql://lab@db/stage"')
    assert machine.text.endswith(after + load_machine().text)
    assert "s3cret" not in str(machine.document.data)
    assert parse_machine(machine.text, "recording").history == "postgresql://lab@db/stage"


def test_an_address_without_a_password_is_left_as_written():
    text = "history: postgresql://lab@db/stage\n" + load_machine().text
    assert parse_machine(text, "machine.yaml").text == text
