"""Interrupted runs that are gone on with, and sites that are begun again after a fault."""

import json
import os
import signal
from dataclasses import replace
from datetime import UTC, datetime
from multiprocessing import get_context

import numpy as np
import pytest
from click.testing import CliRunner

from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from stagectl.cli import cli
from stagectl.errors import StagectlError, UnusableInput
from stagectl.recipe import parse_recipe
from stagectl.run import Listener, RunRequest, execute, load_interrupted
from stagectl.run.replay import replay
from stagectl.sequencer import Exposed, Mode, MoveStarted
from stagectl.store import read_log, read_notes, read_recording, recover_folder, recover_log

HEAD = """\
recipe: short
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
"""
SITES = HEAD + (
    "expose: 0.02\n"
    "sites: [[0.004, -0.003], [0.02, 0.01], [0.0, 0.02], [-0.015, 0.0], [0.01, 0.01]]\n"
    "fiducial: {source: simulated, range: 80.0e-6, seed: 1}\n"
)
MOVES = HEAD + (
    "moves: [{to: [0.01, 0.0]}, {reverse: 100 um, axis: x}, {dwell: 50 ms},"
    " {reverse: 200 um, axis: x}, {to: [0.0, 0.005]}]\nfiducial: {source: none}\n"
)
FOLLOWING, OVER_CURRENT = 0x8611, 0x2310


@pytest.fixture
def sites(machine):
    return parse_recipe(SITES, "short.yaml", machine)


@pytest.fixture
def go(machine, tmp_path):
    """A run on the virtual stage; `at` asks for a fault of drive y in this many moves from now."""

    def run(recipe, folder, *, faults=(), listener=None, **options):
        request = RunRequest(
            recipe, machine, machine, None, Mode.ESTIMATED, options.pop("scale", 1.0), 1,
            tmp_path / folder, datetime.now(UTC), f.FaultPlan(tuple(faults), 1) if faults else None,
            **options,
        )  # fmt: skip
        return execute(request, listener or Listener())

    return run


def failing_at(move, code=FOLLOWING, times=1):
    """Listens to a run and has drive y fail in the middle of a move (counted from 1)."""
    stages, begun = [], 0

    def event(happened):
        nonlocal begun
        if isinstance(happened, MoveStarted):
            begun += 1
            if move <= begun < move + times:
                drive, world = stages[0].drives[1], stages[1]
                world.at(world.now_ns + 5_000_000, lambda: drive.inject_fault(code))

    return Listener(event=event, switched_on=lambda *both: stages.extend(both)), stages


def test_a_run_goes_on_at_the_site_that_it_was_at(go, sites, tmp_path):
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


def test_friction_goes_on_from_what_was_accepted_last(go, sites, tmp_path):
    listener, _ = failing_at(6)
    first = go(sites, "first", listener=listener, scale=0.5)
    resumed = load_interrupted(tmp_path / "first", sites)
    known = [e for e in first.summary["friction"] if e["accepted"]][-2:]
    for entry in known:
        for name in ("coulomb", "viscous", "stiffness"):
            value = entry["parameters"][name]["value"]
            assert resumed.friction[entry["axis"]][name][0] == value
        rate = resumed.friction[entry["axis"]]["relaxation_rate"][0]
        attraction = entry["parameters"]["attraction"]["value"]
        assert rate * entry["parameters"]["coulomb"]["value"] == pytest.approx(attraction)
    peaks = {}
    for name, link in (("going on", resumed), ("from half", replace(resumed, friction={}))):
        run = go(sites, name, resumed=link, scale=0.5)
        peaks[name] = [m["peak_error"] for m in run.summary["moves"] if m["site"] == 3][:2]
    assert np.max(peaks["going on"]) < 0.7 * np.max(peaks["from half"])


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
        for take in (
            lambda: load_interrupted(folder, sites),
            lambda: replay(folder),
            lambda: recover_folder(folder),
            lambda: recover_log(folder),
        ):
            with pytest.raises(StagectlError, match=r"recording\.journal: .* in progress"):
                take()
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


def test_a_site_is_begun_again_after_a_fault(go, sites, tmp_path):
    listener, stages = failing_at(6)
    result = go(sites, "run", listener=listener, retries=1)
    assert result.summary["outcome"] == "completed"
    assert [m.site for m in result.recording.moves] == [1, 1, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5]
    (retry,) = result.summary["retries"]
    assert (retry["site"], retry["attempt"]) == (3, 1)
    assert "0x8611" in retry["fault"]
    assert "Site 3 was restarted" in (tmp_path / "run" / "report.html").read_text()
    # the move that was broken off ends where its samples do
    broken, after = result.recording.moves[5], result.recording.moves[6]
    assert broken.end <= after.start
    entries = [m for m in result.summary["moves"] if m["site"] == 3 and m["kind"] == "micro"]
    assert [m.get("completed", True) for m in entries] == [False, False, True, True]
    # time goes on, with a gap where the fault was acknowledged
    gaps = np.diff(result.recording.time) > 1.5e-3
    assert gaps.sum() == 1
    assert broken.start < np.flatnonzero(gaps)[0] < after.start
    final = {e["axis"]: e for e in result.summary["friction"] if e["accepted"]}
    assert final["y"]["site"] == 5
    assert all(d.motion.state is State.SWITCH_ON_DISABLED for d in stages[0].drives)
    assert read_recording(tmp_path / "run" / "recording.h5").moves == result.recording.moves


def test_a_drive_that_reboots_is_homed_again_whatever_the_other_does_meanwhile(go, sites):
    faults = [f.Reboot(2, 3.2), f.DriveFault(1, FOLLOWING, at=4.2)]
    result = go(sites, "run", faults=faults, retries=2)
    assert result.summary["outcome"] == "completed"
    rebooted, on_the_way = result.summary["retries"]
    assert "axis y" in rebooted["fault"]
    assert "the drive rebooted" in rebooted["fault"]
    assert "axis x" in on_the_way["fault"]
    assert "0x8611" in on_the_way["fault"]
    assert rebooted["site"] == on_the_way["site"]
    assert result.summary["micro"]["count"] == 10


@pytest.mark.parametrize(
    ("code", "times", "retries", "made"),
    [(FOLLOWING, 9, 2, 2), (OVER_CURRENT, 1, 2, 0), (FOLLOWING, 1, 0, 0)],
    ids=["it comes every time", "somebody has to look first", "nobody asked for it"],
)
def test_when_a_fault_ends_the_run_all_the_same(go, sites, code, times, retries, made):
    listener, stages = failing_at(6, code, times)
    result = go(sites, "run", listener=listener, retries=retries)
    assert result.summary["outcome"] == "fault"
    assert f"0x{code:04X}" in result.summary["fault"]
    assert len(result.summary.get("retries", ())) == made
    assert all(d.motion.state is not State.ENABLED for d in stages[0].drives)


def test_what_cannot_be_gone_on_with(go, sites, machine, tmp_path):
    with pytest.raises(UnusableInput, match="no such folder"):
        load_interrupted(tmp_path / "nobody", sites)
    (tmp_path / "empty").mkdir()
    with pytest.raises(UnusableInput, match="holds no recording"):
        load_interrupted(tmp_path / "empty", sites)
    go(sites, "complete")
    with pytest.raises(UnusableInput, match="is complete"):
        load_interrupted(tmp_path / "complete", sites)
    listener, _ = failing_at(2)
    go(sites, "first", listener=listener)
    other = parse_recipe(SITES.replace("0.02\n", "0.03\n"), "other.yaml", machine)
    with pytest.raises(UnusableInput, match="another recipe than other"):
        load_interrupted(tmp_path / "first", other)


def test_from_the_command_line(go, sites, tmp_path):
    (tmp_path / "r.yaml").write_text(SITES)
    listener, _ = failing_at(6)
    go(sites, "a", listener=listener)

    def run(*options):
        arguments = ["run", str(tmp_path / "r.yaml"), "--simulate", *options]
        handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
        try:
            return CliRunner().invoke(cli, arguments)
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)

    folder, other = str(tmp_path / "a"), str(tmp_path / "b")
    clash = run("--resume", folder, "--out", folder)
    assert clash.exit_code == 2
    assert "needs its own folder" in clash.output
    told = tmp_path / "plan.json"
    planned = run("--resume", folder, "--dry-run", "--json", str(told))
    assert planned.exit_code == 0, planned.output
    plan = json.loads(told.read_text())
    assert plan["sites"] == len(sites.sites) - 2
    assert plan["moves"]["macro"] == plan["sites"]
    rest = run("--resume", folder, "--out", other, "--retries", "1")
    assert rest.exit_code == 0, rest.output
    assert "after the first 2 sites" in rest.output
