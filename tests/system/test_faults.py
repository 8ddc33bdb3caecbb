"""Runs with faults: each ends in a named way and a safe state, and keeps its recording."""

import json
from datetime import UTC, datetime

import h5py
import numpy as np
import pytest

from benchmarks.robustness import fault_campaign as campaign
from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from stagectl.recipe import parse_recipe
from stagectl.run import Listener, RunRequest, SimulatedStage, execute
from stagectl.sequencer import FrictionUpdated
from stagectl.store import read_recording


@pytest.fixture(scope="module")
def recipe(machine):
    return parse_recipe(campaign.RECIPE, "four-sites.yaml", machine)


@pytest.fixture
def run_with(machine, recipe, tmp_path):
    """A run of four sites with these faults: result, folder, watch."""

    def go(*faults, folder="run", seed=1, listener=None):
        watch = campaign.Watch()
        listener = listener or Listener(switched_on=watch)
        request = RunRequest(
            recipe,
            machine,
            tmp_path / folder,
            datetime.now(UTC),
            simulated=SimulatedStage(machine, seed, f.FaultPlan(tuple(faults), seed)),
        )
        return execute(request, listener), tmp_path / folder, watch

    return go


@pytest.mark.parametrize("first", range(1, 21, 10))
@pytest.mark.slow
def test_a_slice_of_the_campaign(machine, recipe, tmp_path, first):
    for number in range(first, first + 10):
        scenario = campaign.make_scenario(number)
        outcome = campaign.run(scenario, machine, recipe, tmp_path / str(number))
        assert outcome.violations == [], f"{scenario}\n{outcome.cause}"


# What the campaign found once.
FOUND = {
    "bus-off of a drive that is back before it misses the host": f.BusOff(1, 1.77, 0.088),
    "no SYNC gets through": f.Drop(f.Frames(frozenset({0x080}), "host", after=1.73)),
    "one drive gets no setpoints, not even to switch off": f.Freeze(
        f.Frames(frozenset({0x202}), "host", after=1.9)
    ),
    "the SYNC's jitter looks like friction": f.Delay(
        f.Frames(frozenset({0x080}), "host"), 0.0, 1.157e-4
    ),
}


@pytest.mark.parametrize("name", FOUND)
def test_what_the_campaign_found(machine, recipe, tmp_path, name):
    scenario = campaign.Scenario(54, (name,), f.FaultPlan((FOUND[name],), 54))
    outcome = campaign.run(scenario, machine, recipe, tmp_path)
    assert outcome.struck
    assert outcome.violations == [], outcome.cause


@pytest.mark.parametrize(
    "fault",
    [
        f.Drop(f.Frames(frozenset({0x202}), "host", after=2.6)),
        f.Freeze(f.Frames(frozenset({0x182}), "drives", after=2.6)),
    ],
    ids=["setpoints do not reach the drive", "positions do not reach the host"],
)
def test_an_axis_that_does_not_follow_ends_the_run(run_with, fault):
    result, _, watch = run_with(fault)
    assert result.summary["outcome"] == "fault"
    assert result.summary["fault"].startswith("axis y: 0x6064:00 position actual: ")
    assert all(drive.motion.state is not State.ENABLED for drive in watch.stage.drives)


def test_the_same_faults_give_the_same_run(run_with):
    plan = (
        f.Drop(f.Frames(frozenset({0x181}), "drives", probability=0.01)),
        f.Delay(f.Frames(frozenset({0x080}), "host"), 0.0, 5e-6),
        f.DriveFault(2, 0x2310, at=3.0),
    )
    (one, first, _), (two, second, _) = run_with(*plan), run_with(*plan, folder="again")
    assert one.summary["fault"] == two.summary["fault"]
    for axis in ("x", "y"):
        for signals in ("position_actual", "force_actual", "valid"):
            assert np.array_equal(
                getattr(one.recording.axes[axis], signals),
                getattr(two.recording.axes[axis], signals),
            )
    logs = [(folder / "bus.asc").read_text().split("\n", 6)[-1] for folder in (first, second)]
    assert logs[0] == logs[1]


def test_lost_tpdos_keep_their_place_and_are_masked_by_the_estimator(run_with):
    """The same samples but for those lost, which stand marked; the figures hardly change."""
    plain, _, _ = run_with(folder="plain")
    lossy, folder, watch = run_with(
        f.Drop(f.Frames(frozenset({0x181}), "drives", after=2.0, probability=0.01))
    )
    (injected,) = watch.world.injected
    assert lossy.summary["outcome"] == "completed"
    recording = read_recording(folder / "recording.h5")
    lost = np.flatnonzero(~recording.axes["x"].valid)
    assert recording.axes["y"].valid.all()
    # those outside the streams (disabling) are not in the recording
    assert 5 < len(lost) <= injected.count
    assert lossy.summary["cycle"]["missed"] == len(lost)
    np.testing.assert_allclose(np.diff(recording.time), 1e-3, atol=1e-9)
    position = recording.axes["x"].position_actual
    alone = lost[~np.isin(lost - 1, lost)]
    np.testing.assert_array_equal(position[alone], position[alone - 1])  # the last one stands
    with h5py.File(folder / "recording.h5") as file:
        np.testing.assert_array_equal(np.flatnonzero(file["axes/x/valid"][:] == 0), lost)
    final = [
        {e["axis"]: e["parameters"] for e in result.summary["friction"] if e["accepted"]}["x"]
        for result in (plain, lossy)
    ]
    for name, tolerance in (("coulomb", 0.02), ("viscous", 0.05), ("stiffness", 0.03)):
        assert final[1][name]["value"] == pytest.approx(final[0][name]["value"], rel=tolerance)


def test_a_position_that_lies_is_not_learned_from(run_with):
    """Lost samples taken for measurements would be refused; frozen ones have to be as well."""
    said = []
    listener = Listener(event=lambda e: said.append(e) if isinstance(e, FrictionUpdated) else 0)
    run_with(
        f.Freeze(f.Frames(frozenset({0x181}), "drives", after=2.8, until=3.0)), listener=listener
    )
    for event in said:
        if event.axis == "x" and event.estimate.accepted:
            assert event.estimate.friction.coulomb == pytest.approx(6.0, rel=0.08)


def test_what_was_injected_is_in_the_recording(run_with):
    _, folder, _ = run_with(f.DriveFault(2, 0x2310, at=3.0), f.Reboot(1, at=30.0))
    with h5py.File(folder / "recording.h5") as file:
        text = json.dumps({k: str(v) for k, v in file.attrs.items()}) + "".join(
            str(file[name][()]) for name in file if isinstance(file[name], h5py.Dataset)
        )
    assert "injected_fault" in text


def test_faults_from_the_command_line(stagectl, tmp_path):
    (tmp_path / "recipe.yaml").write_text(campaign.RECIPE)
    (tmp_path / "faults.yaml").write_text(
        "faults:\n  - {fault: drive, axis: y, error: over_current, position: 5 mm}\n"
    )
    done = stagectl(
        "run", "recipe.yaml", "--simulate", "--faults", "faults.yaml", "--out", "out", cwd=tmp_path
    )
    assert done.returncode == 3
    assert "axis y" in done.stderr
    assert "over-current" in done.stderr
    assert "Traceback" not in done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["outcome"] == "fault"
    assert "0x2310" in summary["fault"]


@pytest.mark.parametrize(
    ("text", "options", "word"),
    [
        ("faults: [{fault: dropp, frame: sync}]", ["--simulate"], "faults.yaml:1:18: faults[1]"),
        ("faults: [{fault: reboot, axis: q, at: 1}]", ["--simulate"], "no such axis"),
        ("faults: [{fault: reboot, axis: x, at: 1}]", [], "--simulate"),
        (None, ["--simulate"], "faults.yaml"),
    ],
)
def test_unusable_faults_files(stagectl, tmp_path, text, options, word):
    (tmp_path / "recipe.yaml").write_text(campaign.RECIPE)
    if text is not None:
        (tmp_path / "faults.yaml").write_text(text)
    done = stagectl(
        "run", "recipe.yaml", *options, "--faults", "faults.yaml", "--out", "out", cwd=tmp_path
    )
    assert done.returncode == 2
    assert word in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()
