"""The runs of a history as a table and as JSON."""

import json

import pytest
from click.testing import CliRunner

from stagectl.cli import cli
from stagectl.history import open_history
from tests.unit.stagectl.rows import estimate_record, run_entry

LONG = "a lot whose name is longer than the terminal is wide"


@pytest.fixture
def where(tmp_path):
    path = str(tmp_path / "stage.db")
    history = open_history(path, write=True)
    for lot, day in ((LONG, 0.0), ("[/b]", 86400.0)):
        run = history.start_run(run_entry(started=day, axes=("x",), lot=lot))
        history.add([estimate_record(run, figures={"coulomb": 6.0}, covariance=(0.01,))])
        history.end_run(run, "completed")
    history.close()
    return path


def listed(*arguments):
    done = CliRunner().invoke(cli, ["history", "list", *arguments], env={"COLUMNS": "40"})
    assert done.exit_code == 0, done.output
    return done.stdout


def test_every_name_stays_whole_on_a_narrow_terminal(where):
    rows = listed("--history", where).splitlines()
    (first,) = (row for row in rows if "1970-01-01" in row)
    assert LONG in first
    assert first.split()[-6:] == ["6.000", "±", "0.1", "1", "of", "1"]
    assert any("[/b]" in row for row in rows), "a name is no markup"


def test_filters_and_json(where):
    options = ("--history", where, "--since", "1970-01-02", "--json", "-")
    told = json.loads(listed(*options))
    assert told["format"] == "stagectl-history-runs"
    (run,) = told["runs"]
    assert (run["lot"], run["started"], run["outcome"]) == ("[/b]", 86400.0, "completed")
    assert run["axes"] == {"x": {"estimates": 1, "accepted": 1, "coulomb": 6.0, "sigma": 0.1}}
    assert json.loads(listed(*options, "--lot", "other"))["runs"] == []
    assert "no such runs of wafer-xy" in listed("--history", where, "--purpose", "calibration")
