"""The settling observer in whole runs: on the stage as modelled, and on others."""

import json
from pathlib import Path
from statistics import mean

import numpy as np
import pytest
from click.testing import CliRunner

from benchmarks.settling.observer import cases
from benchmarks.settling.wrong_file import (
    at_constant_speed,
    at_rest,
    rows,
    slow_moves,
    with_effect,
    with_mass,
    with_quirks,
)
from benchmarks.shared.inspection_runs import Case, run_whole
from benchmarks.shared.other_stages import of_law
from stagectl.cli import cli
from stagectl.config.faults import parse_faults
from stagectl.config.machine import Effect
from stagectl.recipe import parse_recipe
from stagectl.run.replay import replay
from stagectl.sequencer import Mode
from tests.short_recipe import short_recipe

RECIPE = Path(__file__).parents[2] / "recipes" / "inspection-20.yaml"
UNKNOWN = {
    "x": Effect("cogging", {"amplitude": 1.2, "pitch": 0.032, "phase": 0.5}),
    "y": Effect("cable_hysteresis", {"force": 1.0, "stiffness": 2500.0}),
}
TRUTHS = {"all up": (1.6, 1.6, 1.6, 1.2), "all down": (0.6, 0.6, 0.6, 0.8)}


def settling(results, kind):
    """To 50 nm, from site 4 on [s]."""
    return [
        move["settling"]["5e-08"]
        for result in results
        for move in result.summary["moves"]
        if move["kind"] == kind and move["site"] >= 4
    ]


def with_effects(machine, effects):
    axes = {
        name: axis.model_copy(update={"effects": (effects[name],)})
        for name, axis in machine.axes.items()
    }
    return machine.model_copy(update={"axes": axes})


def test_as_modelled_from_half_of_the_figures(run, typical):
    results = [typical[0], run("estimated", 2, 0.5)]
    assert mean(settling(results, "micro")) <= 0.002
    assert mean(settling(results, "macro")) <= 0.008
    for result in results:
        assert all(entry["on"] for entry in result.summary["observer"].values())
        accepted = [entry["accepted"] for entry in result.summary["friction"]]
        assert mean(accepted) >= 0.9
        last = {e["axis"]: e["parameters"]["coulomb"]["value"] for e in result.summary["friction"]}
        assert last == pytest.approx({"x": 6.0, "y": 9.0}, rel=0.03)


@pytest.mark.parametrize("truth", TRUTHS)
def test_figures_off(run, machine, truth, altered):
    results = [run("estimated", 1, 0.5, altered(machine, *TRUTHS[truth]))]
    assert mean(settling(results, "micro")) <= 0.006
    assert mean(settling(results, "macro")) <= 0.009


def test_effects_that_the_host_does_not_know(run, machine):
    stage = with_effects(machine, UNKNOWN)
    observed = [run("estimated", seed, 0.5, stage) for seed in (1, 2)]
    assert mean(settling(observed, "micro")) <= 0.015
    assert mean(settling(observed, "macro")) <= 0.022
    assert mean(settling([run("model", 1, 1.0, stage)], "micro")) <= 0.03


LACKING = {
    "payload_mass": ({"mass": 0.72}, "acceleration takes 9.0 %", "mass", 8),
    "dead_time": ({"delay": 5e-4}, "force acts 0.4", "lead", 20),
    "cross_coupling": ({"mass": 0.26}, "the other axis' acceleration acts on 3.", "coupling", 20),
}
"""Effect on x -> its parameters, what the run says of it, the figure that it is taken for, and
macro-moves' mean to 50 nm at most [ms].
Not learned, x needs 26, 28 and 109 ms."""


SCALE = {"mass": 0.3, "lead": 1e-3, "coupling": 0.3}


@pytest.mark.slow
@pytest.mark.parametrize("effect", LACKING)
def test_what_the_planned_force_lacks_is_learned(run, machine, effect):
    values, said, figure, most = LACKING[effect]
    axes = dict(machine.axes)
    axes["x"] = axes["x"].model_copy(update={"effects": (Effect(effect, values),)})
    truth = machine.model_copy(update={"axes": axes})
    result = run("estimated", 1, 0.5, truth, measured=machine)  # the stage has changed since
    late = [m for m in result.summary["moves"] if m["kind"] == "macro" and m["site"] >= 8]
    assert mean(1e3 * m["settling"]["5e-08"] for m in late if m["axis"] == "x") <= most
    [notice] = [n for n in result.notices if "fed forward" in n]
    assert notice.startswith(f"axis x: {said}")
    learned = result.summary["feedforward"]["x"]
    assert max(learned, key=lambda name: abs(learned[name] / SCALE[name])) == figure


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stage", "share"),
    [
        (lambda m: with_mass(m, 0.67), -0.33),
        (lambda m: with_mass(m, 1.37), 0.37),
        (lambda m: with_effect(m, "force_constant", ratio=0.5), 1.0),
        (lambda m: with_quirks(m, position_filter=3e-4), 0.0),
    ],
    ids=["mass x 0.67", "mass x 1.37", "force constant x 0.5", "position filtered"],
)
def test_a_cause_is_not_taken_for_its_rival(run, machine, stage, share):
    """A mass of a third less was 0.8 ms of lead, a late position 18 % more mass."""
    result = run("estimated", 1, 0.5, stage(machine), measured=machine)
    learned = result.summary.get("feedforward")
    if learned is None:
        assert share == 0.0  # the observer stepped back before anything was learned
        return
    for axis in ("x", "y"):
        assert learned[axis]["mass"] == pytest.approx(share, abs=0.01)
        assert learned[axis]["lead"] == learned[axis]["coupling"] == 0.0


def test_what_was_measured_is_fed_forward_from_the_first_move(run, machine):
    """Lead and force per acceleration; otherwise y, which hardly moves, learns them late."""
    truth = with_effect(with_mass(machine, 1.37), "dead_time", delay=5e-4)
    result = run("estimated", 1, 0.5, truth)
    for axis in ("x", "y"):
        fed = result.summary["feedforward"][axis]
        assert fed["mass"] == pytest.approx(0.37, abs=0.02)
        assert fed["lead"] == pytest.approx(5e-4, abs=6e-5)
    macro = [m for m in result.summary["moves"] if m["kind"] == "macro"]
    assert mean(1e3 * m["settling"]["5e-08"] for m in macro) <= 20


def test_what_is_as_in_the_machine_file_is_not(typical):
    assert not [n for n in typical[0].notices if "fed forward" in n]


def test_friction_without_presliding_is_found_and_no_spring_assumed(run, machine):
    """With a spring assumed the observer settles later than the drive does alone."""
    stage = of_law(machine, "coulomb")
    off, on = (
        [run("model", seed, 0.5, stage, observer=o, measured=machine) for seed in (1, 2)]
        for o in (False, True)
    )
    micro, macro = (
        mean(settling(on, kind)) / mean(settling(off, kind)) for kind in ("micro", "macro")
    )
    assert micro <= 0.8
    assert macro <= 0.9  # by chance of stick-slip, 0.77 to 0.93 from seed to seed
    assert (micro + macro) / 2.0 <= 0.8
    for result in on:
        found = [n for n in result.notices if "sticks without presliding" in n]
        assert [n[:6] for n in found] == ["axis x", "axis y"]
        texts = [finding["text"] for finding in result.summary.get("watchdog", ())]
        assert not [text for text in texts if "grows" in text]  # it sticks


@pytest.mark.slow
@pytest.mark.parametrize("case", ["as modelled", "base_motion", "floor_vibration", "resonance"])
def test_presliding_is_not_taken_for_sticking(run, machine, case):
    """These change the force on an axis most while it hardly moves."""
    truth = cases(machine)[case][0](1)
    assert not [n for n in run("estimated", 1, 0.5, truth).notices if "presliding" in n]


def test_without_it_nothing_is_corrected(run, tmp_path):
    summary = run("model", observer=False, folder=tmp_path / "run").summary
    assert "observer" not in summary
    assert "feedforward" not in summary
    assert "integrator holds" not in (tmp_path / "run" / "report.html").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "seeds"),
    [
        ("{fault: sync_jitter, most: 20 us}", 3),
        ("{fault: sync_miss, axis: x, probability: 0.01}", 3),
        ("{fault: drop, frame: rpdo1, probability: 0.01}", 3),
        ("{fault: delay, frame: sync, least: 100 us, most: 300 us, probability: 0.01}", 6),
    ],
    ids=["jitter", "SYNC missed", "setpoints lost", "SYNC late"],
)
def test_what_the_bus_does_is_not_answered_by_force(run, machine, tmp_path, fault, seeds):
    recipe = tmp_path / "ten-sites.yaml"
    recipe.write_text(RECIPE.read_text().replace("count: [5, 4]", "count: [5, 2]"))
    off, on = [], []
    for seed in range(1, seeds + 1):  # where in a move frames are late or lost is chance
        faults = parse_faults(f"faults: [{fault}]", "faults", machine, 6 + seed)
        for results, observer in ((off, False), (on, True)):
            results.append(
                run("estimated", seed, 0.5, recipe=recipe, observer=observer, faults=faults)
            )
    for kind in ("micro", "macro"):
        assert mean(settling(on, kind)) <= 0.6 * mean(settling(off, kind))
    peaks = [
        mean(m["peak_error"] for r in results for m in r.summary["moves"] if m["kind"] == "macro")
        for results in (off, on)
    ]
    assert peaks[1] <= 1.1 * peaks[0]


def test_a_machine_file_that_wants_none(run, machine, tmp_path):
    off = machine.model_copy(
        update={
            "axes": {
                name: axis.model_copy(update={"observer": "none" if name == "x" else "auto"})
                for name, axis in machine.axes.items()
            }
        }
    )
    recipe = tmp_path / "short.yaml"
    recipe.write_text(short_recipe((0.004, -0.003)))
    folder = tmp_path / "run"
    result = run("model", 1, 0.5, recipe=recipe, host=off, folder=folder)
    page = (folder / "report.html").read_text()
    assert result.summary["observer"]["x"] == {
        "on": False,
        "reason": "switched off in the machine file",
    }
    assert result.summary["observer"]["y"]["on"]
    assert "none (switched off in the machine file)" in page
    assert "the drive's own integrator holds the difference" in page


def test_a_run_is_repeated_by_its_log(typical):
    assert replay(typical[1]).difference is None


def test_the_offsets_sent_are_in_the_recording(typical, machine):
    """At rest the offset and what the integrator holds are the measured force."""
    x = typical[0].recording.axes["x"]
    last = slice(-20, None)
    assert np.ptp(x.force_offset[last]) <= 2.5 * machine.axes["x"].drive.force_unit
    error = x.position_demand[last] - x.position_actual[last]
    assert np.abs(error).max() < 60e-9


def test_the_command_prints_gain_and_margins():
    told = CliRunner().invoke(cli, ["observer", "--json", "-"])
    assert told.exit_code == 0, told.output
    x = json.loads(told.output)["axes"]["x"]
    assert x["on"]
    assert 0.05 < x["gain"] < 0.3
    peaks = x["sensitivity_peak"]
    assert peaks["drive_alone"] < peaks["latency_1"] < peaks["latency_2"] <= peaks["worst"] <= 2.0
    shown = CliRunner().invoke(cli, ["observer"])
    assert "gain per SYNC" in shown.output


def slow_run(machine, truth, observer):
    """Both axes at 10 mm/s; the error there [nm], and the result."""
    result = run_whole(
        Case("", Mode.ESTIMATED, observer=observer, measured=machine),
        parse_recipe(slow_moves(0.01), "slow", machine), machine, 1, truth,
    )  # fmt: skip
    errors = [
        at_constant_speed(result.recording.axes[name], 0.01, axis, 1e-3)[0]
        for name, axis in truth.axes.items()
    ]
    return max(errors), result


@pytest.mark.parametrize("row", ["drive gains x 0.5", "offset 5 SYNCs late", "position 1 SYNC old"])
def test_an_observer_that_the_stage_contradicts_steps_back_and_says_why(machine, row):
    truth = rows(machine)[row]
    without, _ = slow_run(machine, truth, observer=False)
    error, result = slow_run(machine, truth, observer=True)
    assert error <= 1.3 * without
    found = result.summary["watchdog"]
    assert {entry["axis"] for entry in found if entry["out"]} == {"x", "y"}
    assert max(entry["time"] for entry in found) <= 0.4  # 0.1 s of rest come first
    assert all(entry["text"] in result.notices for entry in found)


def test_a_vibration_from_elsewhere_is_told_and_nothing_steps_back(machine):
    truth = cases(machine)["floor_vibration"][0](1)
    found = slow_run(machine, truth, observer=True)[1].summary["watchdog"]
    assert [entry["out"] for entry in found] == [False, False]
    assert all("comes from elsewhere" in entry["text"] for entry in found)


SPEEDS, DWELL = (2e-3, 50e-3), 10.0
STEADY = """\
recipe: steady
macro: {velocity: 0.05, acceleration: 0.5, jerk: 50}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
moves:
- {to: [0.052, 0.052]}
- {to: [0, 0]}
- {to: [0.002, 0.002], velocity: 2 mm/s}
- {to: [0, 0], velocity: 2 mm/s}
- {dwell: 10 s}
"""
"""Without an observer the offset takes over what the integrator holds in the first long move, at
10 N/s; both runs have that at the same speed. Friction is not estimated: at 2 mm/s an estimate that
was made while the stage oscillated decides, by chance of the seed."""


@pytest.fixture(scope="module", params=["1.2 N of cogging", "drive gains x 0.5"])
def steady_runs(machine, request):
    """Runs without and with the observer that the machine file's stage was measured for."""
    truth, results = rows(machine)[request.param], []
    for observer in (False, True):
        case = Case("", Mode.MODEL, observer=observer, measured=machine)
        recipe = parse_recipe(STEADY, "steady", machine)
        results.append(run_whole(case, recipe, machine, 1, truth))
    return truth, results


@pytest.mark.parametrize("speed", SPEEDS)
def test_no_constant_speed_is_worse_with_it(steady_runs, speed):
    truth, results = steady_runs
    for name, axis in truth.axes.items():
        off, on = (
            at_constant_speed(result.recording.axes[name], speed, axis, 1e-3)[0]
            for result in results
        )
        assert on <= 1.3 * off


def test_a_long_rest_is_not_worse_with_it(steady_runs):
    truth, results = steady_runs
    for name in truth.axes:
        (off, force_off), (on, force_on) = (
            at_rest(result.recording.axes[name], DWELL, 1e-3) for result in results
        )
        assert on <= off + 5.0
        assert force_on <= force_off + 0.05
