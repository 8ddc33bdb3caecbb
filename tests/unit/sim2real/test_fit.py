"""One axis tracked and fitted: innovations, their response to effects, models that cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.settings import SUBSTEPS, StageSettings
from sim2real.attribution import Scanner, likeness
from sim2real.fitting import (
    NUISANCES,
    STEP,
    AxisModel,
    AxisProblem,
    Term,
    coordinates,
    fit,
    fitted,
    implausible,
    is_level,
    moved,
    plausible,
    structure,
    within_tolerance,
)
from sim2real.gap import prepare
from sim2real.recording import Recording
from sim2real.tracking import Tracker, respond
from tests.unit.sim2real.conftest import FINER, stage_with


def problem_of(recording: Recording, settings: StageSettings, axis: str = "x") -> AxisProblem:
    return AxisProblem([Tracker(prepare(recording, settings), settings, axis)], 0.003)


def test_innovations_of_the_right_model_are_white(
    nominal: tuple[Recording, StageSettings],
) -> None:
    recording, settings = nominal
    problem = problem_of(recording, settings, "x")
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
    problem = problem_of(recording, settings, "x")
    track, gains = problem.tracks[0], problem.gains[0]
    term = Term(library()["cogging"], (0.3, 0.03, 1.0))
    simulated = problem.track(AxisModel(np.zeros(NUISANCES), (term,)))[0].position - track.position
    force = -0.3 * np.sin(2.0 * np.pi * track.x / 0.03 + 1.0)
    predicted = -respond(gains, gains.force, force)
    assert np.corrcoef(simulated, predicted)[0, 1] > 0.9


def test_models_side_by_side_are_tracked_as_each_by_itself(
    nominal: tuple[Recording, StageSettings],
) -> None:
    problem = problem_of(*nominal)
    base = problem.start.base.copy()
    base[0], base[STEP] = 0.01, 0.4
    heavier, nothing = AxisModel(base), problem.start
    waved = nothing.added(Term(library()["cogging"], (0.3, 0.03, 1.0)))
    tied = nothing.added(Term(library()["cross_coupling"], (0.1,)))
    weightless = nothing.added(Term(library()["payload_mass"], (-1e3,)))
    models = [heavier, waved, weightless, tied, nothing]
    each = [None if m is weightless else problem.residual(m) for m in models]
    for found, own in zip(problem.residuals(models), each, strict=True):
        assert (found is None) == (own is None)
        if found is not None:
            np.testing.assert_array_equal(found, own)
    assert problem.all_attempted([weightless])[0].min() > 1e3
    finer, models = problem.finer(), [heavier, nothing, waved]
    for found, model in zip(finer.residuals(models), models, strict=True):
        np.testing.assert_array_equal(found, finer.residual(model))


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
    problem = problem_of(recording, settings, "y")
    start = problem.at_start()
    scanner = Scanner(
        problem, start.model, start.residual,
        problem.base_columns(start.model, start.residual), problem.weights(start.residual),
    )  # fmt: skip
    known = library()
    followed = [s for s in scanner.best(known["coulomb_level"]) if s.followed]
    assert len(followed) == 1
    assert followed[0].term.values[0] == pytest.approx(0.9, abs=0.03)
    offsets = scanner.best(known["force_offset"])
    assert not [s for s in offsets if s.followed]
    signatures = {"coulomb_level": followed[0].signature, "force_offset": offsets[0].signature}
    ((_, alike),) = likeness(signatures, list(signatures)).items()
    assert 0.0 < alike < 0.5


def test_how_finely_a_stage_is_stepped_is_found_beside_its_figures(
    nominal: tuple[Recording, StageSettings],
) -> None:
    problem = problem_of(stage_with(nominal, 20), nominal[1], "y")
    found = fit(problem, problem.start, 4, thorough=False)
    assert found.model.base[STEP] == pytest.approx(1.0 - SUBSTEPS / FINER, abs=0.05)
    assert np.abs(found.model.base[:STEP]).max() < 5.0 * 0.003


def test_gains_of_another_model_change_every_cost(
    nominal: tuple[Recording, StageSettings],
) -> None:
    recording = stage_with(nominal, 21, x={"coulomb_level": {"ratio": 1.3}})
    problem = problem_of(recording, nominal[1])
    known = Term(library()["coulomb_level"], (1.3,))
    before = fit(problem, AxisModel(np.zeros(NUISANCES), (known,)), 2, thorough=False)
    problem.regain(before.model)
    after = problem.revalued(before)
    assert after.cost < before.cost  # the filter that knows the friction foretells more
    assert after.cost == problem.cost(after.model, after.residual)


def test_a_fit_steps_back_from_what_cannot_be(nominal: tuple[Recording, StageSettings]) -> None:
    problem = problem_of(*nominal)
    stiff = AxisModel(np.zeros(NUISANCES), (Term(library()["presliding_stiffness"], (1e4,)),))
    with pytest.raises(ValueError, match="too stiff"):
        problem.residual(stiff)
    worst = problem.attempted(stiff)
    assert problem.cost(stiff, worst) > 10.0 * problem.cost(
        problem.start, problem.residual(problem.start)
    )


def test_long_control_periods_are_simulated_in_the_references_steps(
    nominal: tuple[Recording, StageSettings],
) -> None:
    settings = nominal[1]
    slow = replace(
        settings,
        axes=tuple(replace(a, control=replace(a.control, period=1e-3)) for a in settings.axes),
    )
    assert settings.quick_substeps == 1
    assert slow.quick_substeps == SUBSTEPS


@pytest.mark.parametrize(
    ("effect", "values", "tenths", "near"),
    [
        ("coulomb_level", (1.36,), 1.0, (1.3,)),
        ("coulomb_level", (1.05,), 0.0, (1.05,)),
        ("thermal_drift", (0.05, 20.0), 0.0, (0.05, 20.0)),  # small, but of that sign
        ("thermal_drift", (-0.03, 20.0), 1.0, (0.0, 20.0)),
        ("friction_position", (0.3, 0.0, 0.1), 5.0, (0.3, 0.0, 0.025)),
        ("cogging", (-1.0, 0.03, 0.0), 0.0, (-1.0, 0.03, 0.0)),  # half a turn
        ("force_saturation", (90.0,), 0.0, (90.0,)),
    ],
)
def test_values_beyond_what_is_plausible_are_told(
    nominal: tuple[Recording, StageSettings],
    effect: str,
    values: tuple[float, ...],
    tenths: float,
    near: tuple[float, ...],
) -> None:
    axis = nominal[1].axes[0]
    term = Term(library()[effect], values)
    assert implausible(term, axis) == pytest.approx(tenths, abs=1e-9)
    assert plausible(term, axis).values == near


def test_courses_of_the_coulomb_level_are_told_from_other_friction(
    nominal: tuple[Recording, StageSettings],
) -> None:
    axis = nominal[1].axes[0]
    middle = {
        name: Term(e, tuple(p.ranges(axis)[-1][1] for p in e.parameters))
        for name, e in library().items()
        if e.searched
    }
    courses = {name for name, term in middle.items() if is_level(term, axis)}
    assert courses == {"coulomb_level", "thermal_drift", "friction_position"}
