"""Probabilities of causes where a search kept little to compare them with."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from hil_sim.effects.library import library
from sim2real.attribution import AxisSearch, find_causes
from sim2real.attribution.alternatives import Alternative
from sim2real.fitting import Term, fit
from tests.unit.sim2real.conftest import problem_of, stage_with


@pytest.fixture(scope="module")
def drift(nominal):
    """A warm-up, fitted; no other set of effects was kept."""
    values = {"amplitude": 0.3, "time_constant": 4.0}
    recording = stage_with(nominal, 51, seconds=3.0, y={"thermal_drift": values})
    problem = problem_of(recording, nominal[1], "y")
    term = Term(library()["thermal_drift"], tuple(values.values()))
    best = fit(problem, problem.start.added(term), 1, thorough=False)
    return AxisSearch(
        axis=problem.axis,
        spread=problem.spread,
        problem=problem,
        plain=problem.nominal_fit(),
        best=best,
        open_gap=50.0,
        closes=1.0,
    )


def test_an_effect_on_the_level_that_is_out_of_the_question(drift):
    """Odds of levels may be smaller than a number can be."""
    found = replace(drift, levels={"thermal_drift": {"coulomb_level": 0.0}})
    assert found.probability("thermal_drift") == (pytest.approx(0.99), [])
    near = replace(drift, levels={"thermal_drift": {"coulomb_level": 0.6}})
    probability, others = near.probability("thermal_drift")
    assert probability == pytest.approx(0.99 / 1.6)
    assert others == ["coulomb_level"]


def test_names_are_less_sure_where_structure_is_left(drift):
    held_out = SimpleNamespace(given_back=lambda axis, index: (0.9, (0.8, 1.0)))
    for is_complete, most in ((True, 0.99), (False, 0.85)):
        (cause,), _ = find_causes(
            replace(drift, is_complete=is_complete), held_out, along_motion=False
        )
        assert cause.probability == pytest.approx(most)


def test_what_is_not_needed_beside_a_curve_is_not_named(drift):
    held_out = SimpleNamespace(given_back=lambda axis, index: (0.9, (0.8, 1.0)))
    doubted = replace(drift, doubted=("thermal_drift",))
    (cause,), _ = find_causes(doubted, held_out, along_motion=False)
    assert cause.probability == pytest.approx(0.45)


def test_a_search_without_names_predicts_no_move_by_effects(drift):
    """Else what they close would count as nothing left: no gap."""
    coordinate = SimpleNamespace(axis="y", over="time")
    found = replace(drift, folds=(drift.best.model,)).without_names((coordinate,))
    assert found.folds == ()
    assert found.best is drift.plain
    assert found.unlisted == (coordinate,)


def test_a_start_counts_only_where_it_scores_better(drift):
    found = replace(drift, alternatives=(Alternative(drift.best, 2.0),))
    plain = drift.problem.start
    assert found.with_start(plain, lambda _: 50.0) is found
    missed = replace(found, best=drift.plain, alternatives=(Alternative(drift.plain, 50.0),))
    better = missed.with_start(drift.best.model, lambda _: 2.0)
    assert better.best.model.names() == ("thermal_drift",)
    assert better.is_complete
    assert [a.model.names() for a in better.alternatives] == [("thermal_drift",), ()]
