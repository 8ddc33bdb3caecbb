"""Passwords in comments, which a file's text would carry into recordings and reports."""

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.config.parsing.comments import without_passwords


@pytest.mark.parametrize(
    ("line", "kept"),
    [
        ("# history: postgresql://lab:s3cret@db/stage", "# history: postgresql://lab@db/stage"),
        ("x: 1  # was postgresql://lab:s3c/r@et@db/s", "x: 1  # was postgresql://lab@db/s"),
        ("# host=db user=lab password=s3cret dbname=d", "# host=db user=lab password=*** dbname=d"),
        ("#password: 's3cret s3cret' (old)", "#password: *** (old)"),
        ('# PGPASSWORD = "s3cret"', "# PGPASSWORD = ***"),
    ],
)
def test_what_looks_like_a_password_is_taken_out(line, kept):
    assert without_passwords(f"a: b\n{line}\nc: d") == f"a: b\n{kept}\nc: d"


@pytest.mark.parametrize(
    "text",
    [
        "a: 'postgresql://lab:s3cret@db/s'",  # a value, for whoever reads the key
        "# see https://example.org:8080/a (15:00, ask a@b.org)\n",
        "# gains by A. Meier: kp = 2e5\n",
        "a: b#c\n",
    ],
)
def test_everything_else_stays_as_written(text):
    assert without_passwords(text) == text


def test_a_machine_files_comments_are_passed_on_without_passwords():
    text = load_machine().text + "# history: postgresql://lab:s3cret@db/stage\n"
    machine = parse_machine(text, "machine.yaml")
    assert "s3cret" not in machine.text
    assert parse_machine(machine.text, "recording").text == machine.text
