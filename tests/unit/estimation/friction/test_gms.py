"""The estimator's friction model: closed forms, both directions, derivatives, and the plant's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from estimation.friction import FrictionState, breakaway_travel, element_shares, follow
from stagedata import FrictionFigures

TEN = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
TS = 1e-3


def run(friction, position, state=None, substeps=4, period=TS, band=0.0):
    position = np.asarray(position, dtype=float)
    state = state or FrictionState.relaxed(friction.elements, position[0])
    velocity = np.gradient(position, period)
    return follow(friction, state, position, velocity, period, substeps, band)


def test_both_directions_are_mirror_images():
    t = np.arange(400) * TS
    x = 60e-6 * np.sin(2 * np.pi * 3 * t) * np.exp(-t)
    plus, _ = run(TEN, x)
    minus, _ = run(TEN, -x)
    np.testing.assert_allclose(minus, -plus, atol=1e-12)


def test_very_fast_relaxation_is_stable():
    # C h > 2 |S| would blow up an Euler step.
    force, _ = run(replace(TEN, relaxation_rate=1e6), np.linspace(0.0, 1e-2, 100))
    assert np.isfinite(force).all()
    assert force[-1] == pytest.approx(6.0, rel=1e-3)


def test_encoder_noise_at_rest_moves_nothing():
    rng = np.random.default_rng(1)
    state = FrictionState(element_shares(10) * 6.0, np.ones(10, dtype=bool), np.array([1.0, 0.0]))
    x = np.round(rng.normal(0.0, 1e-9, 2000) / 1e-9) * 1e-9
    force, _ = follow(TEN, state, x, np.gradient(x, TS), TS)
    assert np.abs(force - 6.0).max() < 0.02


def test_reversal_inside_a_sample_is_seen():
    coarse_t, fine_t = np.arange(0, 80) * TS, np.arange(0, 800) * TS / 10
    profile = lambda t: 30e-6 * np.sin(2 * np.pi * 12.3 * t)  # noqa: E731
    coarse, _ = run(TEN, profile(coarse_t), substeps=8)
    fine, _ = run(TEN, profile(fine_t), substeps=8, period=TS / 10)
    assert np.abs(coarse - fine[::10]).max() < 0.03 * 6.0


@pytest.mark.parametrize(
    ("name", "column"), [("coulomb", 0), ("stiffness", 1), ("relaxation_rate", 2)]
)
def test_sensitivities_are_the_derivatives(name, column):
    t = np.arange(300) * TS
    x = 3e-3 * np.sin(2 * np.pi * 2 * t) + 20e-6 * np.sin(2 * np.pi * 9 * t)
    _, jacobian = run(TEN, x)
    value = getattr(TEN, name)
    step = 1e-6 * value
    above, _ = run(replace(TEN, **{name: value + step}), x)
    below, _ = run(replace(TEN, **{name: value - step}), x)
    numeric = (above - below) / (2 * step)
    # Where an element starts to slip the force has a kink: a few samples may differ there.
    wrong = np.abs(jacobian[:, column] - numeric) > 1e-3 * np.abs(numeric).max()
    assert wrong.mean() < 0.02


def test_breakaway_travel_is_where_all_slip():
    travel = breakaway_travel(TEN)
    state = FrictionState.relaxed(10)
    # Slow: the Stribeck curve is at its static value.
    x = np.linspace(0.0, 1.02 * travel, 200)
    follow(TEN, state, x, np.full(200, 1e-9), TS, 1, 0.0)
    assert state.slipping.all()
    state = FrictionState.relaxed(10)
    follow(TEN, state, 0.97 * x / 1.02, np.full(200, 1e-9), TS, 1, 0.0)
    assert not state.slipping.all()


class TestCorrection:
    def test_no_element_passes_its_static_limit(self):
        state = FrictionState.relaxed(10)
        state.correct(8.0, TEN)
        limits = element_shares(10) * 6.0 * 1.4
        assert (np.abs(state.forces) <= limits + 1e-12).all()
        state.correct(100.0, TEN)
        np.testing.assert_allclose(state.forces, limits)

    def test_agreement_changes_nothing(self):
        state = FrictionState(
            element_shares(10) * np.linspace(-3.0, 6.0, 10), np.zeros(10, dtype=bool), np.zeros(2)
        )
        before = state.forces.copy()
        state.correct(float(before.sum()), TEN)
        np.testing.assert_allclose(state.forces, before, atol=1e-9)


def test_agrees_with_the_plants_own_friction():
    # Two programs, two step sizes: the estimator's 1 kHz model against the simulator's 20 us one.
    from hil_sim.plant import Slip, slip_step, stribeck

    t = np.arange(0, 0.35, 2e-5)
    x = 2e-3 * (t / 0.1) ** 2 * np.exp(-t / 0.03) * np.sin(2 * np.pi * 8 * t)
    forces, slipping = np.zeros(10), np.zeros(10, dtype=bool)
    truth, heading = [0.0], 0.0
    for dx in np.diff(x):
        v = dx / 2e-5
        direction = math.copysign(1.0, dx)
        if direction != heading:
            heading = direction
            slipping[:] = False
        curve = stribeck(v, 0.4, 2e-3, 1.0)
        truth.append(
            slip_step(
                forces, slipping, element_shares(10),
                Slip(direction, dx, 6.0 * curve, math.exp(-100.0 * 2e-5 / curve)), 6e4, 10,
            )
        )  # fmt: skip
    model, _ = run(TEN, x[::50])
    assert np.sqrt(np.mean((model - np.array(truth)[::50]) ** 2)) < 0.03 * 6.0
