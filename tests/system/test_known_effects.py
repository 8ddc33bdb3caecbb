"""The loop of a control engineer: run, diagnose, run with the twin; and runs that know effects."""

import json

import numpy as np
import pytest

from stagectl.config import load_machine

RECIPE = """\
recipe: few-sites
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
expose: 0.02
sites: {grid: {origin: [-0.03, -0.03], pitch: [0.02, 0.02], count: [4, 3], order: serpentine}}
fiducial: {source: simulated, range: 80.0e-6, seed: 1}
"""


def with_effects(path, x="", y="", wander=0.01):
    """The packaged machine with effects, and Coulomb forces that wander by this much."""
    text = load_machine().text.replace("{coulomb: 0.01,", f"{{coulomb: {wander},")
    for node, effects in (("1", x), ("2", y)):
        if effects:
            text = text.replace(
                f"    node: {node}\n", f"    node: {node}\n    effects: [{effects}]\n", 1
            )
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def recipe(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "few-sites.yaml"
    path.write_text(RECIPE)
    return path


def mean_settling(summary, axis=None):
    """Of all moves of a run from the third site on [ms]."""
    times = [
        move["settling"]["5e-08"]
        for move in summary["moves"]
        if move["site"] >= 3 and axis in (None, move["axis"])
    ]
    return 1e3 * sum(times) / len(times)


def force_of_no_name(path):
    """A stage whose hose pulls and whose cover drags as no effect of the library does."""
    x, v = np.linspace(-0.06, 0.06, 121), np.linspace(-0.6, 0.6, 61)
    tables = {
        "position": x,
        "force": 1.2 * np.tanh((x + 0.01) / 0.012) + 750.0 * x * np.abs(x),
        "coulomb": np.ones(len(x)),
        "velocity": v,
        "velocity_force": 15.0 * v * np.abs(v),
    }
    lists = "".join(f", {key}: {[float(f'{n:.6g}') for n in of]}" for key, of in tables.items())
    return with_effects(path, x=f"{{effect: residual_table{lists}}}")


@pytest.mark.slow
def test_what_no_effect_explains_is_compensated_in_the_next_run(stagectl, tmp_path):
    truth, recipe = force_of_no_name(tmp_path / "truth.yaml"), tmp_path / "two-rows.yaml"
    recipe.write_text(RECIPE.replace("count: [4, 3]", "count: [5, 2]"))
    before, after, twin = tmp_path / "before", tmp_path / "after", tmp_path / "twin.yaml"
    options = ("--simulate", truth, "--no-observer", "--out")
    for command in (
        ("run", recipe, *options, before),
        ("gap", "diagnose", before / "recording.h5", "--twin", twin, "--json", tmp_path / "r.json"),
        ("run", recipe, "--machine", twin, *options, after),
    ):
        done = stagectl(*command)
        assert done.returncode == 0, done.stderr
    assert "x residual_table" in done.stdout
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["verdict"] in ("unexplained", "partly_explained")
    assert "residual_table" not in {c["effect"] for c in report["causes"] + report["candidates"]}
    assert "# On x, residual_table: a description and no cause." in twin.read_text()
    done = stagectl(
        "gap", "compare", before / "recording.h5", after / "recording.h5", "--json", "-"
    )
    assert json.loads(done.stdout)["gap_closed"] > 0.85
    settling = [
        mean_settling(json.loads((out / "summary.json").read_text()), "x")
        for out in (before, after)
    ]
    assert settling[1] < 0.85 * settling[0]


@pytest.fixture(scope="module")
def run_of(run, recipe):
    """Its summary; the mean of its ten moves scatters by a fifth."""

    def go(host, truth):
        return run(seed=1, host=host, truth=truth, recipe=recipe, observer=False).summary

    return go


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return load_machine(with_effects(tmp_path_factory.mktemp("plain") / "m.yaml", wander=0.001))


@pytest.fixture(scope="module")
def without(run_of, plain):
    """Mean settling of a stage without effects [ms]."""
    return mean_settling(run_of(plain, plain), "y")


@pytest.mark.parametrize(
    "effect",
    [
        "{effect: force_ripple, ratio: 0.055, pitch: 0.011, phase: 3}",
        "{effect: friction_asymmetry, ratio: 0.13}",
        "{effect: friction_position, amplitude: 0.4, center: 0, width: 0.015}",
        "{effect: dead_time, delay: 0.0005}",
        "{effect: cross_coupling, mass: 0.375}",
        "{effect: base_motion, frequency: 10, damping: 0.08, mass_ratio: 0.03}",
        "{effect: low_speed_friction, ratio: 0.5, speed: 0.01}",
    ],
    ids=lambda effect: effect.split(",")[0].split()[-1],
)
def test_a_known_effect_no_longer_delays_settling(run_of, plain, without, tmp_path, effect):
    truth = load_machine(with_effects(tmp_path / "truth.yaml", y=effect, wander=0.001))
    unknown, known = run_of(plain, truth), run_of(truth, truth)
    made_up = mean_settling(known, "y")
    assert made_up < 1.5 * without
    assert made_up < 0.7 * mean_settling(unknown, "y")
    assert sum(not e["accepted"] for e in known["friction"]) <= 2
    assert "effects" not in unknown


def test_what_cannot_be_compensated_is_named_at_the_start(stagectl, recipe, tmp_path):
    machine = with_effects(
        tmp_path / "m.yaml",
        x="{effect: force_offset, force: 1}",
        y="{effect: floor_vibration, amplitude: 0.01, frequency: 40, phase: 0}",
    )
    out = tmp_path / "out"
    run = ("run", recipe, "--machine", machine, "--simulate", "--no-observer", "--out", out)
    done = stagectl(*run)
    assert done.returncode == 0, done.stderr
    reason = "y: floor_vibration is not compensated: its phase is another in every run"
    assert done.stdout.index(reason) < done.stdout.index("few-sites on wafer-xy")
    effects = json.loads((out / "summary.json").read_text())["effects"]
    assert [(e["axis"], e["effect"], e["compensated"]) for e in effects] == [
        ("x", "force_offset", True), ("y", "floor_vibration", False),
    ]  # fmt: skip
    assert "not compensated: y floor_vibration" in (out / "report.html").read_text("utf-8")
    replayed = stagectl("replay", out)
    assert replayed.returncode == 0, replayed.stdout


def test_a_run_without_compensation_leaves_all_effects(stagectl, recipe, tmp_path):
    machine = with_effects(tmp_path / "m.yaml", x="{effect: force_offset, force: 1}")
    out = tmp_path / "out"
    done = stagectl(
        "run", recipe, "--machine", machine, "--simulate", "--compensation", "none", "--out", out
    )
    assert done.returncode == 0, done.stderr
    (effect,) = json.loads((out / "summary.json").read_text())["effects"]
    assert not effect["compensated"]
