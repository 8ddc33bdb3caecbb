"""What is printed at the end of a run."""

import pytest

from stagectl.cli.outcome import render_outcome
from stagectl.run import HostSettings, Listener, execute
from stagectl.store import SPOOL_NAME
from tests.unit.stagectl.printed import printed
from tests.unit.stagectl.run.whole import SITES, request_for


@pytest.fixture(scope="module")
def finished(machine, tmp_path_factory):
    """The result of a run of five sites that learns friction from half of it."""
    folder = tmp_path_factory.mktemp("finished")
    request = request_for(machine, folder, SITES, host=HostSettings(friction_scale=0.5))
    return execute(request, Listener()), folder


def outcome(result, folder, width=100):
    return printed(render_outcome(result, folder), width)


def rows(text, axis):
    return [line.split() for line in text.splitlines() if line.split()[:1] == [axis]]


def test_a_completed_run(finished):
    text = outcome(*finished)
    assert text.startswith("short on wafer-xy: Completed. 5 sites in ")
    assert "x real time" in text
    assert "bus.asc, recording.h5, report.html, summary.json" in " ".join(text.split())
    assert "to continue" not in text


def test_moves_are_told_apart_by_the_friction_behind_their_offsets(finished):
    """Count and peak error are of the summary's moves of that axis, kind and model."""
    moves = [row for row in rows(outcome(*finished), "x") if row[1] in ("macro", "micro")]
    kinds = [(row[1], row[2], int(row[3])) for row in moves]
    assert {kind for kind, _, _ in kinds} == {"macro", "micro"}
    assert {model for _, model, _ in kinds} == {"initial", "updated"}
    listed = [m for m in finished[0].summary["moves"] if m["axis"] == "x"]
    assert sum(count for _, _, count in kinds) == len(listed)


def test_an_incomplete_bus_log_is_named_with_the_remedy(finished, tmp_path):
    (tmp_path / SPOOL_NAME).write_bytes(b"")
    assert f"stagectl recover {tmp_path}" in outcome(finished[0], tmp_path, width=300)


def test_a_narrow_terminal_cuts_no_figures(finished):
    wide, narrow = (outcome(*finished, width) for width in (100, 40))
    figures = [row for axis in "xy" for row in rows(wide, axis)]
    assert figures
    assert [row for axis in "xy" for row in rows(narrow, axis)] == figures
