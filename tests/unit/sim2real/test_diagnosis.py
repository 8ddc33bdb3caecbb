"""Which effects cause a gap: tracking, fitting and the whole diagnosis on simulated stages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from hil_sim.effects.library import library
from hil_sim.settings import StageSettings
from hil_sim.simulate import simulate
from sim2real.axis_model import (
    NUISANCES,
    AxisModel,
    Term,
    coordinates,
    fitted,
    moved,
    within_tolerance,
)
from sim2real.diagnosis import Diagnosis, diagnose
from sim2real.examine import examine
from sim2real.experiment import next_experiment
from sim2real.fit import AxisProblem, fit, structure
from sim2real.gap import compare_with
from sim2real.recording import Recording
from sim2real.replay import prepare
from sim2real.scan import Scanner
from sim2real.strangers import KIN
from sim2real.tracking import Tracker, respond
from stagectl.config.machine import load_machine, parse_machine
from stagectl.config.mapping import stage_settings
from stagectl.recipe.load import load_recipe
from stagectl.store.recording import read_recording

DATA = Path(__file__).parents[2] / "data"
TOLERANCE = {"x": 0.003, "y": 0.003}
SECONDS = 3.0


@pytest.fixture(scope="module")
def nominal() -> tuple[Recording, StageSettings]:
    recording = read_recording(DATA / "null-1.h5")
    return recording, stage_settings(parse_machine(recording.machine, "null-1"))


def stage_with(
    nominal: tuple[Recording, StageSettings], seed: int, **effects: dict[str, dict[str, float]]
) -> Recording:
    """A recording of a stage with effects (axis -> effect -> values), finer steps, other plant."""
    recording, settings = nominal
    count = round(SECONDS / settings.sync_period)
    rng = np.random.default_rng(seed)
    known = {e.name: e for e in KIN} | dict(library())
    axes = []
    for axis in settings.axes:
        terms = tuple(
            Term(known[name], tuple(values.values()))
            for name, values in effects.get(axis.name, {}).items()
        )
        axes.append(
            AxisModel(TOLERANCE[axis.name] * rng.standard_normal(NUISANCES), terms).settings(axis)
        )
    replay = prepare(recording, settings)
    run = simulate(
        replace(settings, axes=tuple(axes)), replay.demand[:count], replay.offset[:count], seed,
        substeps=8,
    )  # fmt: skip
    signals = {
        name: replace(
            of,
            position_demand=of.position_demand[:count],
            force_offset=of.force_offset[:count],
            position_actual=run.position[:, a],
            force_actual=run.force[:, a],
            statusword=None,
            valid=of.valid[:count],
        )
        for a, (name, of) in enumerate(recording.axes.items())
    }
    moves = tuple(m for m in recording.moves if m.end < count)
    return replace(
        recording, time=recording.time[:count], axes=signals, moves=moves, source=f"seed {seed}"
    )


def told(recording: Recording, settings: StageSettings, *names: str) -> Diagnosis:
    """The diagnosis with a library of these effects."""
    known = library()
    examined = examine([recording], settings)
    return diagnose(examined, TOLERANCE, {name: known[name] for name in names})


def test_innovations_of_the_right_model_are_white(
    nominal: tuple[Recording, StageSettings],
) -> None:
    recording, settings = nominal
    problem = AxisProblem([Tracker(prepare(recording, settings), settings, "x")], 0.003)
    found = fit(problem, problem.start, 2, thorough=False)
    innovations = problem.positions(found.residual)
    lagged = np.corrcoef(innovations[:-10], innovations[10:])[0, 1]
    assert 0.7 < innovations.std() < 1.1
    assert abs(lagged) < 0.1
    assert problem.white(found.residual)


def test_response_to_a_force_is_what_a_simulation_shows(
    nominal: tuple[Recording, StageSettings],
) -> None:
    recording = stage_with(nominal, 3)
    settings = nominal[1]
    problem = AxisProblem([Tracker(prepare(recording, settings), settings, "x")], 0.003)
    track, gains = problem.tracks[0], problem.gains[0]
    term = Term(library()["cogging"], (0.3, 0.03, 1.0))
    simulated = problem.track(AxisModel(np.zeros(NUISANCES), (term,)))[0].position - track.position
    force = -0.3 * np.sin(2.0 * np.pi * track.x / 0.03 + 1.0)
    predicted = -respond(gains, gains.force, force)
    assert np.corrcoef(simulated, predicted)[0, 1] > 0.9


@pytest.mark.parametrize("name", sorted(library()))
def test_coordinates_go_there_and_back(nominal: tuple[Recording, StageSettings], name: str) -> None:
    axis = nominal[1].axes[0]
    effect = library()[name]
    values = []
    for parameter in effect.parameters:
        low, high = parameter.ranges(axis)[-1]
        values.append(0.4 * low + 0.6 * high)
    term = Term(effect, tuple(values))
    assert moved(term, axis, fitted(term, axis)).values == pytest.approx(term.values)
    for entry, value in zip(coordinates(effect, axis), values, strict=True):
        step = 1e-6
        slope = (entry.outward(entry.inward(value) + step) - value) / step
        assert slope == pytest.approx(entry.slope(value), rel=1e-3)


def test_structure_of_white_noise_is_one_and_of_a_drift_is_more() -> None:
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(20_000)
    assert structure(noise) == pytest.approx(1.0, abs=0.25)
    assert structure(noise + np.sin(np.arange(20_000) / 50.0)) > 3.0


def test_an_effect_is_named_with_its_figures(nominal: tuple[Recording, StageSettings]) -> None:
    recording = stage_with(nominal, 11, y={"dead_time": {"delay": 4e-4}})
    found = told(
        recording, nominal[1], "dead_time", "current_bandwidth", "payload_mass", "force_offset"
    )
    assert [(c.axis, c.effect) for c in found.report.causes] == [("y", "dead_time")]
    delay = found.report.causes[0].parameters["delay"]
    assert abs(delay.value - 4e-4) < 3.0 * delay.sigma
    assert found.report.gap_closed is not None
    assert found.report.gap_closed > 0.9


def test_a_stage_within_tolerance_has_no_gap(nominal: tuple[Recording, StageSettings]) -> None:
    recording = stage_with(nominal, 12)
    found = told(recording, nominal[1], "payload_mass", "coulomb_level", "force_offset", "cogging")
    assert found.report.verdict == "no_gap"
    assert found.report.causes == ()


def test_an_effect_outside_the_library_is_not_explained(
    nominal: tuple[Recording, StageSettings],
) -> None:
    recording = stage_with(
        nominal, 13, x={"cogging": {"amplitude": 1.5, "pitch": 0.03, "phase": 0.5}}
    )
    found = told(recording, nominal[1], "force_constant", "dead_time", "cross_coupling")
    assert found.report.verdict in ("unexplained", "partly_explained")


def test_what_the_filter_follows_is_told_by_the_closed_loop(
    nominal: tuple[Recording, StageSettings],
) -> None:
    """Innovations hardly see another friction level: it is a state of the filter."""
    recording = stage_with(nominal, 14, x={"coulomb_level": {"ratio": 0.87}})
    found = told(recording, nominal[1], "coulomb_level", "dead_time", "force_constant")
    assert [(c.axis, c.effect) for c in found.report.causes] == [("x", "coulomb_level")]
    assert found.report.gap_closed is not None
    assert found.report.gap_closed > 0.9
    ranked = {c.effect: c.gap_closed for c in found.report.candidates if c.axis == "x"}
    assert ranked["coulomb_level"] == pytest.approx(found.report.causes[0].gap_closed)


def test_a_spring_with_a_far_center_is_no_offset(
    nominal: tuple[Recording, StageSettings],
) -> None:
    spring = {"stiffness": 12.0, "center": -0.09}
    recording = stage_with(nominal, 15, y={"cable_stiffness": spring})
    found = told(recording, nominal[1], "cable_stiffness", "force_offset")
    assert [(c.axis, c.effect) for c in found.report.causes] == [("y", "cable_stiffness")]
    for key, true in spring.items():
        parameter = found.report.causes[0].parameters[key]
        assert abs(parameter.value - true) < 3.0 * parameter.sigma


def test_an_effect_in_another_shape_keeps_its_name_and_leaves_something(
    nominal: tuple[Recording, StageSettings],
) -> None:
    harmonics = {"amplitude": 1.5, "pitch": 0.03, "phase": 0.7, "second": 0.4, "third": 0.2}
    recording = stage_with(nominal, 16, y={"cogging_harmonics": harmonics})
    found = told(recording, nominal[1], "cogging", "payload_mass")
    assert found.report.verdict == "partly_explained"
    assert [(c.axis, c.effect) for c in found.report.causes] == [("y", "cogging")]
    assert found.report.causes[0].probability > 0.9
    assert "another shape" in found.report.reason


def test_moves_that_would_tell_two_models_apart_are_a_recipe(
    nominal: tuple[Recording, StageSettings], tmp_path: Path
) -> None:
    recording, settings = nominal
    known = library()
    measured = [compare_with(recording, settings)]
    plain = {axis.name: AxisModel(np.zeros(NUISANCES)) for axis in settings.axes}
    coupled = {**plain, "y": plain["y"].added(Term(known["cross_coupling"], (0.4,)))}
    asked = next_experiment("y is pulled", plain, coupled, "y", measured, settings)
    assert asked is not None
    assert asked.why.startswith("y is pulled")
    assert len({move["to"][0] for move in asked.moves if "to" in move}) > 1  # x moves
    path = tmp_path / "next.yaml"
    path.write_text(yaml.safe_dump(asked.recipe()), encoding="utf-8")
    assert load_recipe(path, load_machine()).name == "next-experiment"
    assert next_experiment("nothing", plain, plain, "y", measured, settings) is None


@pytest.mark.parametrize(
    ("effect", "values", "within"),
    [
        ("payload_mass", (0.05,), True),
        ("payload_mass", (-0.3,), False),
        ("coulomb_level", (1.01,), True),
        ("coulomb_level", (0.97,), False),
        ("dead_time", (1e-6,), False),
        ("cable_stiffness", (0.1, 0.0), False),
    ],
)
def test_a_figure_off_by_tolerance_is_no_effect(
    nominal: tuple[Recording, StageSettings],
    effect: str,
    values: tuple[float, ...],
    within: bool,
) -> None:
    axis = nominal[1].axes[0]
    assert within_tolerance(Term(library()[effect], values), axis, 0.003) is within


def test_a_wander_with_a_course_is_a_start_for_what_scales_friction(
    nominal: tuple[Recording, StageSettings],
) -> None:
    recording = stage_with(nominal, 17, y={"coulomb_level": {"ratio": 0.9}})
    settings = nominal[1]
    problem = AxisProblem([Tracker(prepare(recording, settings), settings, "y")], 0.003)
    start = problem.at_start()
    scanner = Scanner(
        problem, start.model, start.residual,
        problem.base_columns(start.model, start.residual), problem.weights(start.residual),
    )  # fmt: skip
    known = library()
    followed = [s for s in scanner.best(known["coulomb_level"]) if s.followed]
    assert len(followed) == 1
    assert followed[0].term.values[0] == pytest.approx(0.9, abs=0.03)
    assert not [s for s in scanner.best(known["force_offset"]) if s.followed]
