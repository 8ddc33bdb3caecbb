"""`stagectl replay`: what it prints of the first difference."""

import json
import shutil
import subprocess
import sys

import pytest
from click.testing import CliRunner

from stagectl.cli import cli
from tests.unit.stagectl.run.replay.logged import edit, run


@pytest.fixture(scope="module")
def made(machine, tmp_path_factory):
    """The folder of a run without faults."""
    folder = tmp_path_factory.mktemp("made") / "run"
    assert run(machine, folder).summary["outcome"] == "completed"
    return folder


@pytest.fixture
def folder(made, tmp_path):
    """A copy of it, to be changed."""
    return shutil.copytree(made, tmp_path / "run")


def test_a_frame_that_the_host_sends_differently_is_the_first_one_told(folder):
    number = edit(folder / "bus.asc", r"( 201 .* d 8 \w\w \w\w) \w\w", r"\1 7F", 900)
    edit(folder / "bus.asc", r"( 202 .* d 8 \w\w \w\w) \w\w", r"\1 7F", 950)
    result = CliRunner().invoke(cli, ["replay", str(folder)])
    assert result.exit_code == 1
    assert "was modified after the run" in result.output
    assert f"differs at frame {number}" in result.output
    assert result.output.count("RPDO 1 of axis x: enable operation") == 2
    program = [sys.executable, "-m", "stagectl", "replay", str(folder)]
    done = subprocess.run(program, capture_output=True, check=False)
    assert done.returncode == 1  # the program's own, not click's


def test_what_the_host_gets_differently_shows_where_it_acts_on_it(folder):
    """A position that was received otherwise changes an offset later on, by the estimate."""
    number = edit(folder / "bus.asc", r"( 181 .* d 8) 37 12", r"\1 18 02", 400)  # FAULT
    result = CliRunner().invoke(cli, ["replay", str(folder), "--json", "-"])
    difference = json.loads(result.output)["difference"]
    assert difference["number"] > number
    assert "quick stop" in difference["sent"]["meaning"]
    assert "enable operation" in difference["recorded"]["meaning"]
