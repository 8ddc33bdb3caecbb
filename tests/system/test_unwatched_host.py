"""A drive without 0x1016: every command that powers it refuses, or says so before it does."""

import pytest
from click.testing import CliRunner

from hil_sim.cia301 import EDS_PATH
from stagectl.cli import cli
from stagectl.config.machine.file import load_machine
from stagectl.errors import RunFault
from stagectl.store import read_notes
from tests.short_recipe import short_recipe

SAID = "axis x: 0x1016:01 consumer heartbeat time"
SITES = "calibrate: weekly\nsites: [[0, 0], [0.02, 0], [0, 0.02], [0.02, 0.02]]\n"


@pytest.fixture
def stagectl(tmp_path):
    """A command on a machine file whose drive x has no 0x1016 by its EDS."""
    before, _, after = EDS_PATH.read_text().partition("[1016]\n")
    text = before.replace("9=0x1016", "9=0x1017") + after[after.index("[1017]") :]
    (tmp_path / "without.eds").write_text(text)
    (tmp_path / "recipe.yaml").write_text(short_recipe((0.001, 0.001)))
    (tmp_path / "sites.yaml").write_text(SITES)

    def go(*arguments, accepted=False):
        keys = "eds: without.eds\n    drive:\n"
        if accepted:
            keys += "      unwatched_host: accept\n"
        machine = load_machine().text.replace("drive:\n", keys, 1)
        (tmp_path / "machine.yaml").write_text(machine)
        if arguments[0] in ("run", "calibrate"):
            arguments = (*arguments, "--out", tmp_path / "run")
        return CliRunner().invoke(
            cli, [*map(str, arguments), "--machine", str(tmp_path / "machine.yaml"), "--simulate"]
        )

    go.folder = tmp_path
    return go


@pytest.mark.parametrize("command", ["enable", "home", "jog x 1mm", "run", "calibrate"])
def test_it_is_refused(stagectl, command):
    words = command.split()
    if command in ("run", "calibrate"):
        words.append(stagectl.folder / {"run": "recipe.yaml", "calibrate": "sites.yaml"}[command])
    result = stagectl(*words)
    assert isinstance(result.exception, RunFault)
    assert str(result.exception).startswith(SAID)
    assert "unwatched_host: accept" in str(result.exception)


def test_accepted_it_is_said_before_power(stagectl):
    result = stagectl("enable", "--hold", "0.05", accepted=True)
    assert result.exit_code == 0
    assert result.stderr.startswith(SAID)


def test_accepted_a_run_says_so_at_its_start_and_keeps_it(stagectl):
    result = stagectl("run", stagectl.folder / "recipe.yaml", accepted=True)
    assert result.exit_code == 0, result.output
    first, _, rest = result.output.replace("\n", " ").partition("Completed")
    assert SAID in first
    assert SAID in rest
    events = read_notes(stagectl.folder / "run" / "recording.h5").events
    (text,) = [e["text"] for e in events if e["event"] == "limitation"]
    assert text.startswith(SAID)
