"""What is printed at the end of a run."""

import copy
import io
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from rich.console import Console

from stagectl.cli.outcome import render_outcome
from stagectl.recipe import parse_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
from stagectl.store import SPOOL_NAME
from tests.unit.stagectl.run.whole import SITES


@pytest.fixture(scope="module")
def finished(machine, tmp_path_factory):
    """The result of a run of five sites that learns friction from half of it."""
    folder = tmp_path_factory.mktemp("finished")
    request = RunRequest(
        parse_recipe(SITES, "short.yaml", machine),
        machine,
        folder,
        datetime.now(UTC),
        simulated=SimulatedStage(machine),
        host=HostSettings(friction_scale=0.5),
    )
    return execute(request, Listener()), folder


@pytest.fixture
def result(finished):
    run = finished[0]
    return replace(run, summary=copy.deepcopy(run.summary))


def printed(result, folder, width=100):
    console = Console(width=width, file=io.StringIO(), record=True)
    console.print(render_outcome(result, folder), crop=False)
    return console.export_text()


def rows(text, axis):
    return [line.split() for line in text.splitlines() if line.split()[:1] == [axis]]


def test_a_completed_run(result, finished):
    text = printed(result, finished[1])
    assert text.startswith("short on wafer-xy: Completed. 5 sites in ")
    assert "x real time" in text
    assert "bus.asc, recording.h5, report.html, summary.json" in " ".join(text.split())
    assert "to continue" not in text


def test_moves_are_told_apart_by_the_friction_behind_their_offsets(result, finished):
    """Count and peak error are of the summary's moves of that axis, kind and model."""
    moves = [row for row in rows(printed(result, finished[1]), "x") if row[1] in ("macro", "micro")]
    kinds = [(row[1], row[2], int(row[3])) for row in moves]
    assert {kind for kind, _, _ in kinds} == {"macro", "micro"}
    assert {model for _, model, _ in kinds} == {"initial", "updated"}
    listed = [m for m in result.summary["moves"] if m["axis"] == "x"]
    assert sum(count for _, _, count in kinds) == len(listed)


def test_without_updates_all_moves_have_the_same_model(result, finished):
    result.summary["compensation"] = "oracle"
    moves = [row for row in rows(printed(result, finished[1]), "x") if row[1] in ("macro", "micro")]
    assert {row[2] for row in moves} == {"true"}


def test_the_friction_is_that_of_the_last_estimate(result, finished):
    used = [e for e in result.summary["friction"] if e["axis"] == "y" and e["accepted"]]
    used[-1]["parameters"]["coulomb"].update(value=8.765, sigma=0.012)
    accepted = [e["accepted"] for e in result.summary["friction"] if e["axis"] == "y"]
    text = printed(result, finished[1])
    assert "8.765" in text
    assert f"{sum(accepted)} of {len(accepted)}" in text


def test_refused_estimates_are_listed_as_far_as_they_can_be_read(result, finished):
    entry = result.summary["friction"][0]
    refused = {**entry, "accepted": False, "site": 3, "axis": "x", "reason": "too little motion"}
    result.summary["friction"] = [refused] * 13
    text = printed(result, finished[1])
    assert text.count("site 3 axis x: too little motion") == 10
    assert "and 3 more" in text
    result.summary["friction"] = [{**refused, "site": None}]
    assert "\n  axis x: too little motion" in printed(result, finished[1])


def test_an_interrupted_run_says_how_to_continue(result, finished):
    result.summary.update({
        "outcome": "fault", "fault": "axis y: 0x8611",
        "interrupted": {"reason": "axis y: 0x8611", "unit": "site", "done": 2, "of": 5, "at": 3,
                        "resume": "stagectl run r.yaml --resume runs/a"},
        "retries": [{"site": 3, "attempt": 1, "fault": "axis y: 0x8611"}],
    })  # fmt: skip
    text = printed(result, finished[1], width=200)
    assert "short on wafer-xy: Ended with a fault. Ended at site 3 of 5" in text
    assert "site 3 restarted (attempt 1): axis y: 0x8611" in text
    assert text.rstrip().endswith("to continue: stagectl run r.yaml --resume runs/a")


def test_failed_sites_are_named_with_what_exceeded_its_limit(result, finished):
    result.summary["limits"] = {
        "verdict": "fail", "passed": 4, "failed": 1, "of": 5,
        "sites": [
            {"site": 1, "passed": True, "failures": []},
            {"site": 2, "passed": False, "failures": ["peak error 1 um"]},
        ],
    }  # fmt: skip
    text = printed(result, finished[1])
    assert "site 2: peak error 1 um" in text
    assert "site 1:" not in text


def test_punctuality_is_mentioned_only_where_it_lacked(result, finished):
    result.summary["cycle"].update({"missed": 0, "late": 0})
    assert "TPDOs missed" not in printed(result, finished[1])
    result.summary["cycle"].update({"missed": 3, "late": 2})
    result.summary["punctuality"] = {"late_in_a_row": 2, "doubled": 1}
    text = printed(result, finished[1])
    assert "3 TPDOs missed, 2 SYNCs late (at most 2 in a row), 1 received twice" in text


def test_an_incomplete_bus_log_is_named_with_the_remedy(result, tmp_path):
    (tmp_path / SPOOL_NAME).write_bytes(b"")
    assert f"stagectl recover {tmp_path}" in printed(result, tmp_path, width=300)


def test_a_narrow_terminal_cuts_no_figures(result, finished):
    wide, narrow = (printed(result, finished[1], width) for width in (100, 40))
    figures = [row for axis in "xy" for row in rows(wide, axis)]
    assert figures
    assert [row for axis in "xy" for row in rows(narrow, axis)] == figures
