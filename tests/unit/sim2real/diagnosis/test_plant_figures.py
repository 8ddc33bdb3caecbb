"""A twin changes the figures that its recordings know, and no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.plant import simulate
from sim2real.attribution import AxisResult
from sim2real.diagnosis import diagnose, examine
from sim2real.diagnosis.plant_figures import settle_figures
from sim2real.fitting import BASE, NUISANCES, STEP, AxisModel, Fitted, Term
from sim2real.gap import prepare_replay
from tests.unit.sim2real.conftest import TOLERANCE

MASS, COULOMB, VISCOUS = (BASE.index(key) for key in ("mass", "coulomb", "viscous"))


@pytest.fixture
def axis(nominal):
    return replace(nominal[1].axes[0], wander=0.0)


def fitted(axis, tolerances, covariance, *terms):
    base = np.zeros(NUISANCES)
    for j, value in tolerances.items():
        base[j] = 0.01 * value
    best = Fitted(AxisModel(base, terms), 0.0, np.empty(0), covariance)
    return AxisResult(axis=axis, spread=np.full(STEP, 0.01), best=best)


def test_what_the_moves_say_little_of_stays_and_is_not_listed(axis):
    covariance = np.eye(STEP)
    covariance[MASS, MASS] = 0.1**2
    model, changes = settle_figures(fitted(axis, {MASS: -1.2, COULOMB: 2.0}, covariance))
    assert model.base[MASS] == pytest.approx(-0.012)
    assert np.count_nonzero(model.base) == 1
    (change,) = changes
    assert (change.axis, change.figure, change.unit, change.written) == ("x", "mass", "kg", True)
    assert change.old == axis.mass
    assert change.new == pytest.approx(axis.mass * 0.988)
    assert change.sigma == pytest.approx(axis.mass * 1e-3, rel=0.01)


def test_of_two_that_only_a_sum_is_known_of_one_stays_and_the_other_has_it_all(axis):
    covariance = 0.01 * np.eye(STEP)
    pair = np.ix_([COULOMB, VISCOUS], [COULOMB, VISCOUS])
    covariance[pair] = [[0.60, -0.60], [-0.60, 0.61]]
    model, changes = settle_figures(fitted(axis, {COULOMB: 1.0, VISCOUS: 0.5}, covariance))
    assert model.base[VISCOUS] == 0.0
    assert model.base[COULOMB] == pytest.approx(0.01 * (1.0 + 0.5 * 0.60 / 0.61))
    assert changes[0].sigma < 0.002 * axis.friction.coulomb


def test_figures_take_what_one_leaves_beside_the_effects_as_reported(axis):
    mass = Term(library()["payload_mass"], (0.4,))
    covariance = np.eye(STEP + 1)
    covariance[MASS, STEP] = covariance[STEP, MASS] = -0.9
    model, changes = settle_figures(fitted(axis, {MASS: 0.7}, covariance, mass))
    assert not changes
    assert not model.base.any()
    assert model.terms == (mass,)


def test_a_figure_at_its_bound_is_a_warning_and_is_not_written(axis):
    model, changes = settle_figures(fitted(axis, {MASS: -5.0}, 0.01 * np.eye(STEP)))
    assert not model.base.any()
    (change,) = changes
    assert not change.written
    assert change.new == pytest.approx(0.95 * axis.mass)
    assert "bound of 5 tolerances" in change.why


def test_a_fit_without_a_sigma_changes_nothing(axis):
    model, changes = settle_figures(fitted(axis, {MASS: 1.0}, np.full((STEP, STEP), np.nan)))
    assert not model.base.any()
    assert not changes


def test_what_the_file_leaves_unknown_has_no_value_to_stay_at(axis):
    model, changes = settle_figures(fitted(axis, {MASS: -5.0}, np.eye(STEP)), unknown=("mass",))
    assert model.base[MASS] == pytest.approx(-0.05)
    assert not changes


def test_an_axis_that_hardly_moves_keeps_its_figures(nominal):
    recording, settings = nominal
    count = round(2.0 / settings.sync_period)
    replay = prepare_replay(recording, settings)
    demand, offset = replay.demand[:count].copy(), replay.offset[:count].copy()
    demand[:, 1] = demand[0, 1] + 1e-6 * np.sin(np.arange(count) * 4e-3)
    offset[:, 1] = 0.0
    x = settings.axes[0]
    heavier = replace(x, effects=(library()["payload_mass"].at(mass=0.8),))
    run = simulate(replace(settings, axes=(heavier, settings.axes[1])), demand, offset, 5)
    axes = {
        name: replace(
            of,
            position_demand=demand[:, a],
            force_offset=offset[:, a],
            position_actual=run.position[:, a],
            force_actual=run.force[:, a],
            statusword=None,
            valid=of.valid[:count],
        )
        for a, (name, of) in enumerate(recording.axes.items())
    }
    moves = tuple(m for m in recording.moves if m.end < count)
    seen = replace(recording, time=recording.time[:count], axes=axes, moves=moves)
    known = {name: library()[name] for name in ("payload_mass", "force_offset")}
    found = diagnose(examine([seen], settings), TOLERANCE, known)
    assert [(c.axis, c.effect) for c in found.report.causes] == [("x", "payload_mass")]
    assert "y" not in found.plant
    assert all(c.axis == "x" or not c.written for c in found.report.figures)
    changed = {c.figure: c.new for c in found.report.figures if c.written}
    assert found.plant.get("x", {}) == pytest.approx(changed)
