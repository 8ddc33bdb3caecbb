"""Where an interrupted run goes on, and with what."""

import os
import signal
from dataclasses import replace
from functools import partial
from multiprocessing import get_context

import numpy as np
import pytest

from stagectl.errors import StagectlError, UnusableInput
from stagectl.recipe import parse_recipe
from stagectl.run import Listener, load_interrupted
from stagectl.run.replay import replay
from stagectl.sequencer import Exposed
from stagectl.store import (
    RunNotes,
    read_log,
    read_notes,
    read_recording,
    recover_folder,
    recover_log,
    write_recording,
)
from stagedata import AxisSignals, Recording
from tests.unit.stagectl.run.whole import MOVES, SITES, failing_at, request_for


def test_a_run_goes_on_at_its_site_with_the_friction_accepted_last(go, sites, tmp_path):
    listener, _ = failing_at(6)  # the micro-move of site 3
    first = go(sites, "first", listener=listener, scale=0.5)
    assert first.summary["outcome"] == "fault"
    left = {p.name: p.read_bytes() for p in (tmp_path / "first").iterdir()}
    resumed = load_interrupted(tmp_path / "first", sites)
    assert resumed.done == 2

    second = go(sites, "second", resumed=resumed, scale=0.5)
    assert second.summary["outcome"] == "completed"
    assert [m.site for m in second.recording.moves] == [3, 3, 4, 4, 5, 5]
    # the same marks, so that both together are the recipe
    again = next(m for m in second.recording.moves if m.kind == "micro")
    before = next(m for m in first.recording.moves if m.site == 3 and m.kind == "micro")
    assert again.target == before.target
    assert {p.name: p.read_bytes() for p in (tmp_path / "first").iterdir()} == left
    assert second.summary["resumed"] == {
        "run": str(tmp_path / "first"), "started": first.recording.started, "done": 2,
    }  # fmt: skip
    page = (tmp_path / "second" / "report.html").read_text()
    assert "after the first 2 sites" in page
    noted = read_notes(tmp_path / "second" / "recording.h5").events[0]
    assert noted["event"] == "run"
    assert noted["resumed"]["run"] == str(tmp_path / "first")
    # and the friction accepted last
    known = [e for e in first.summary["friction"] if e["accepted"]][-2:]
    for entry in known:
        for name in ("coulomb", "viscous", "stiffness"):
            value = entry["parameters"][name]["value"]
            assert resumed.friction[entry["axis"]][name][0] == value
        rate = resumed.friction[entry["axis"]]["relaxation_rate"][0]
        attraction = entry["parameters"]["attraction"]["value"]
        assert rate * entry["parameters"]["coulomb"]["value"] == pytest.approx(attraction)
    anew = go(sites, "from half", resumed=replace(resumed, friction={}), scale=0.5)
    going_on, from_half = (
        max([m["peak_error"] for m in run.summary["moves"] if m["site"] == 3][:2])
        for run in (second, anew)
    )
    assert going_on < 0.7 * from_half


def test_a_run_that_was_killed_goes_on_and_can_be_interrupted_again(go, sites, tmp_path):
    """SIGKILL leaves a journal; the second fault comes before the second run has done anything."""

    def die(happened):
        if isinstance(happened, Exposed) and happened.site == 2:
            os.kill(os.getpid(), signal.SIGKILL)

    child = get_context("fork").Process(
        target=go, args=(sites, "killed"), kwargs={"listener": Listener(event=die)}
    )
    child.start()
    child.join(250)
    assert child.exitcode == -signal.SIGKILL
    assert (tmp_path / "killed" / "recording.journal").exists()

    # it was killed between the end of the exposure and the note that the site is done
    resumed = load_interrupted(tmp_path / "killed", sites)
    assert resumed.done == 1
    assert read_notes(tmp_path / "killed" / "recording.h5").outcome == "killed"
    assert len(read_recording(tmp_path / "killed" / "recording.h5")) > 400
    assert (tmp_path / "killed" / "bus.asc").exists()

    listener, _ = failing_at(1)
    broken = go(sites, "broken", resumed=resumed, listener=listener)
    assert broken.summary["outcome"] == "fault"
    once_more = load_interrupted(tmp_path / "broken", sites)
    assert once_more.done == 1
    assert once_more.friction == resumed.friction != {}
    assert go(sites, "last", resumed=once_more).summary["outcome"] == "completed"


def test_nothing_is_taken_from_a_run_that_still_goes_on(go, sites, tmp_path):
    folder, context = tmp_path / "running", get_context("fork")
    amid, looked = context.Event(), context.Event()

    def wait(happened):
        if isinstance(happened, Exposed) and happened.site == 2:
            amid.set()
            looked.wait(200)

    child = context.Process(
        target=go, args=(sites, "running"), kwargs={"listener": Listener(event=wait)}
    )
    child.start()
    try:
        assert amid.wait(200)
        before = {path.name: path.read_bytes() for path in folder.iterdir()}
        assert {"recording.journal", "bus.frames"} <= set(before)
        resume = partial(load_interrupted, recipe=sites)
        for take in (resume, replay, recover_folder, recover_log):
            with pytest.raises(StagectlError, match=r"recording\.journal: .* in progress"):
                take(folder)
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    finally:
        looked.set()
        child.join(250)
    assert child.exitcode == 0
    log, notes = read_log(folder / "bus.asc"), read_notes(folder / "recording.h5")
    (sealed,) = [e["digest"] for e in notes.events if e["event"] == "bus_log"]
    assert notes.outcome == "completed"
    assert log.stated == log.digest == sealed


def test_a_list_of_moves_goes_on_where_it_was(go, machine, tmp_path):
    moves = parse_recipe(MOVES, "moves.yaml", machine)
    whole = go(moves, "whole")
    listener, _ = failing_at(3)  # the second reversal
    assert go(moves, "first", listener=listener).summary["outcome"] == "fault"
    resumed = load_interrupted(tmp_path / "first", moves)
    assert resumed.done == 3
    rest = go(moves, "rest", resumed=resumed)
    assert rest.summary["outcome"] == "completed"
    back, *others = rest.recording.moves
    assert back.target == whole.recording.moves[1].target
    assert [m.target for m in others] == [m.target for m in whole.recording.moves[2:]]


@pytest.fixture
def interrupted(sites, machine, tmp_path):
    """Write the recording of a run that was stopped; with these events after the run's."""

    def write(*events, before=None, outcome="aborted"):
        folder = tmp_path / "made"
        folder.mkdir(exist_ok=True)
        request = request_for(machine, folder, recipe=sites, resumed=before)
        none = np.zeros(1)
        axes = {
            name: AxisSignals(none, none, none, none, None, none == 0.0) for name in machine.axes
        }
        recording = Recording(machine.text, sites.text, "t", none, axes, (), "")
        noted = [{"event": "run", "sample": 0, **request.as_note()}, *events]
        notes = RunNotes(sites.text, machine.text, "t", outcome, tuple(noted))
        write_recording(recording, folder / "recording.h5", notes=notes)
        return folder

    return write


def test_what_cannot_be_gone_on_with(interrupted, sites, machine, tmp_path):
    with pytest.raises(UnusableInput, match="no such folder"):
        load_interrupted(tmp_path / "nobody", sites)
    (tmp_path / "empty").mkdir()
    with pytest.raises(UnusableInput, match="holds no recording"):
        load_interrupted(tmp_path / "empty", sites)
    with pytest.raises(UnusableInput, match="is complete"):
        load_interrupted(interrupted(outcome="completed"), sites)
    other = parse_recipe(SITES.replace("0.02\n", "0.03\n"), "other.yaml", machine)
    with pytest.raises(UnusableInput, match="another recipe than other"):
        load_interrupted(interrupted(), other)


def friction(axis, accepted=True, local=1.0, **figures):
    return {
        "event": "friction", "sample": 0, "axis": axis, "accepted": accepted, "local": local,
        "parameters": figures,
    }  # fmt: skip


def test_the_figures_are_those_accepted_last(interrupted, sites):
    folder = interrupted(
        friction("x", coulomb=[6.0, 0.1]),
        friction("x", coulomb=[6.5, 0.2], viscous=[20.0, 1.0]),
        friction("x", accepted=False, coulomb=[9.0, 0.1]),
        {"event": "done", "number": 1, "site": 1, "sample": 0},
    )
    resumed = load_interrupted(folder, sites)
    assert resumed.done == 1
    assert resumed.friction == {"x": {"coulomb": (6.5, 0.2), "viscous": (20.0, 1.0)}}


def test_what_a_place_adds_to_the_coulomb_force_does_not_go_along(interrupted, sites):
    """The attraction scales with it, the rate of relaxation does not."""
    figures = {"coulomb": [7.2, 0.36], "attraction": [720.0, 72.0]}
    x = load_interrupted(interrupted(friction("x", local=1.2, **figures)), sites).friction["x"]
    assert x["coulomb"] == pytest.approx((6.0, 0.3))
    rate, sigma = x["relaxation_rate"]
    assert rate == pytest.approx(100.0)
    assert sigma == pytest.approx(100.0 * np.sqrt(0.1**2 - 0.05**2))


def test_a_run_that_got_nowhere_hands_on_what_it_was_given(interrupted, sites):
    first = load_interrupted(
        interrupted(friction("y", coulomb=[9.0, 0.1]), {"event": "done", "number": 2, "sample": 0}),
        sites,
    )
    again = load_interrupted(interrupted(before=first), sites)
    assert (again.done, again.friction) == (2, first.friction)


@pytest.mark.parametrize(
    "damage",
    [
        friction("x", coulomb=[-6.0, 0.1]),
        friction("x", coulomb=[6.0, 0.0]),
        friction("x", coulomb=6.0),
        {"event": "done", "sample": 0},
        {"event": "friction", "sample": 0},
    ],
)
def test_damaged_events_are_refused_in_one_line(interrupted, sites, damage):
    with pytest.raises(UnusableInput, match=r"recording\.h5: /events: damaged \("):
        load_interrupted(interrupted(damage), sites)
