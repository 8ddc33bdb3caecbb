"""Which effect changes the level of Coulomb friction."""

from __future__ import annotations

import pytest

from hil_sim.effects.library import library
from sim2real.attribution.levels import is_wander, settle_levels, weigh_levels
from sim2real.fitting import Term, fit
from tests.unit.sim2real.conftest import problem_of, stage_with

LEVELS = ("coulomb_level", "thermal_drift", "friction_position")


@pytest.mark.parametrize(
    ("true", "values"),
    [
        ("coulomb_level", {"ratio": 0.85}),
        ("thermal_drift", {"amplitude": 0.3, "time_constant": 4.0}),
    ],
)
def test_the_wander_that_is_left_tells_effects_on_the_level_apart(nominal, true, values):
    """Whichever of them was fitted: another level is found beside it."""
    recording = stage_with(nominal, 51, seconds=6.0, y={true: values})
    problem, known = problem_of(recording, nominal[1], "y"), library()
    wrong = Term(known["coulomb_level"], (sum(values.values()) if true == LEVELS[0] else 1.15,))
    fitted = fit(problem, problem.start.added(wrong), 4, thorough=False)
    weighed = weigh_levels(problem, fitted.model, [0], [known[name] for name in LEVELS])
    assert set(weighed) == set(LEVELS)
    assert max(weighed, key=lambda name: weighed[name].value) == true
    found = settle_levels(problem, fitted, {n: known[n] for n in LEVELS}, lambda _: 1.0)
    assert found.best.model.names() == (true,)
    assert all(0.0 < odds <= 1.0 for odds in found.odds[true].values())


def test_a_course_that_the_model_lacks_is_no_wander(nominal):
    """The filter follows it, so innovations are white either way."""
    drift = {"amplitude": 0.3, "time_constant": 4.0}
    recording = stage_with(nominal, 51, seconds=6.0, y={"thermal_drift": drift})
    problem, known = problem_of(recording, nominal[1], "y"), library()
    right = problem.start.added(Term(known["thermal_drift"], tuple(drift.values())))
    level = fit(problem, problem.start.added(Term(known["coulomb_level"], (1.15,))), 4).model
    assert problem.is_nearly_white(problem.residual(level))
    assert is_wander(problem, right)
    assert not is_wander(problem, level)


def settled(
    nominal,
    seed,
    true,
    *start,
):
    """What is decided where a stage has some effects and others were fitted."""
    recording = stage_with(nominal, seed, seconds=6.0, y=true)
    problem, known = problem_of(recording, nominal[1], "y"), library()
    model = problem.start
    for name, values in start:
        model = model.added(Term(known[name], values))
    fitted = fit(problem, model, 4, thorough=False)
    return settle_levels(problem, fitted, {n: known[n] for n in LEVELS}, lambda _: 1.0)


def test_a_slow_drift_may_as_well_be_another_level(nominal):
    drift = {"amplitude": 0.2, "time_constant": 250.0}
    found = settled(nominal, 52, {"thermal_drift": drift}, ("coulomb_level", (1.2,)))
    (chosen,) = found.best.model.names()
    (other,) = {"coulomb_level", "thermal_drift"} - {chosen}
    assert found.odds[chosen][other] > 0.2
    assert {a.model.names() for a in found.fitted} == {("coulomb_level",), ("thermal_drift",)}


def test_one_drift_is_not_a_level_and_another_drift(nominal):
    """They fit as well together; one effect that does is more probable."""
    drift = {"amplitude": 0.24, "time_constant": 57.0}
    start = ("coulomb_level", (1.18,)), ("thermal_drift", (0.04, 6.9))
    found = settled(nominal, 53, {"thermal_drift": drift}, *start)
    assert len(found.best.model.names()) == 1


def test_a_level_and_a_fast_drift_stay_two(nominal):
    """The level at the end is not that of the machine file."""
    drift = {"amplitude": 0.3, "time_constant": 2.0}
    true = {"coulomb_level": {"ratio": 1.25}, "thermal_drift": drift}
    start = ("coulomb_level", (1.2,)), ("thermal_drift", (0.25, 3.0))
    found = settled(nominal, 54, true, *start)
    assert set(found.best.model.names()) == {"coulomb_level", "thermal_drift"}
