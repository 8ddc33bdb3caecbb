"""Commands are imported when called, and a mistyped one is answered with the nearest."""

import sys

import pytest
from click.testing import CliRunner

from stagectl.cli.lazy import LazyGroup

NEVER = "stagectl.cli.no_such_module"


@pytest.fixture
def group():
    return LazyGroup(
        "tool",
        lazy={
            "completion": ("stagectl.cli.completion", "Complete."),
            "broken": (NEVER, "Never imported by the list."),
        },
    )


def test_the_list_of_commands_imports_none(group):
    sys.modules.pop("stagectl.cli.completion", None)
    said = CliRunner().invoke(group, ["--help"])
    assert said.exit_code == 0
    assert said.output.index("completion") < said.output.index("Never imported by the list.")
    assert "stagectl.cli.completion" not in sys.modules


@pytest.mark.parametrize(
    ("typed", "answer"),
    [("completoin", "did you mean 'completion'?"), ("zzz", "No such command 'zzz'")],
)
def test_a_mistyped_command(group, typed, answer):
    said = CliRunner().invoke(group, [typed])
    assert said.exit_code == 2
    assert answer in said.output


def test_a_control_character_is_refused_without_showing_the_argument(group):
    said = CliRunner().invoke(group, ["completion", "s3cret\x1b[0m"])
    assert said.exit_code == 2
    assert "argument 2 holds the control character U+001B" in said.output
    assert "s3cret" not in said.output
