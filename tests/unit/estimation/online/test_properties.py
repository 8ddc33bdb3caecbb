"""Properties of the estimator over frictions, starts, directions and bad samples."""

from dataclasses import replace

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import solveh_banded

from estimation.friction import REST_BAND, FrictionState, element_shares, follow
from estimation.online.belief.belief import BeliefSettings
from estimation.online.estimator import EstimatorSettings, SplitHorizonEstimator
from estimation.online.settings import BOUNDS
from estimation.online.solver.zones import REST, split
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures
from tests.unit.estimation.online.moves import modelled_force, whole

TS, MASS = 1e-3, 8.0
SETTINGS = EstimatorSettings(
    mass=MASS, period=TS, position_noise=1e-9, force_noise=0.0115, model_error=0.0,
    belief=BeliefSettings(wander=0.0),
)  # fmt: skip

frictions = st.builds(
    FrictionFigures,
    elements=st.integers(1, 12),
    coulomb=st.floats(1.0, 30.0),
    viscous=st.floats(0.0, 60.0),
    stiffness=st.floats(1e5, 3e6),
    relaxation_rate=st.floats(5.0, 2e3),
    static_ratio=st.floats(-0.3, 1.0),
    stribeck_velocity=st.floats(5e-4, 1e-2),
    stribeck_shape=st.floats(0.6, 2.0),
)
scales = st.floats(0.4, 2.5)
targets = st.sampled_from([2e-6, 60e-6, 3e-3, 20e-3])
signs = st.sampled_from([1.0, -1.0])


def move(friction, target, seed):
    """Positions and forces of the model on its own samples, noisy, out of relaxed rest."""
    limits = Limits(0.5, 3.0, 100.0) if abs(target) > 1e-3 else Limits(0.01, 0.2, 20.0)
    motion = plan(0.0, target, limits)
    time = np.arange(-3, int(motion.duration / TS) + 30) * TS
    clean = motion.sample(time)[0]
    rng = np.random.default_rng(seed)
    force = predicted(friction, MASS, clean) + rng.normal(0.0, 0.0115, len(clean))
    position = clean + rng.normal(0.0, 1e-9, len(clean))
    return whole(position, force)


def predicted(friction, mass, position):
    return modelled_force(friction, mass, position, band=REST_BAND)


def knowing(friction, settings=SETTINGS):
    rest = FrictionState.relaxed(friction.elements)
    estimator = SplitHorizonEstimator(friction, settings, state=rest)
    estimator.at_rest(0.0, 0.0, 0.0)
    estimator.update(whole(np.zeros(5), np.zeros(5), 0.0))
    return estimator


def cost(data, model, mass, start):
    """Chi-square of the move under the residual's covariance (scipy's), and the arrival cost."""
    moving = np.flatnonzero(split(data.position, start, TS) != REST)
    residual = (predicted(model, mass, data.position) - data.force)[1:-1][moving]
    noise = (MASS * 1e-9 / TS**2) ** 2
    bands = np.array([6 * noise + 0.0115**2, -4 * noise, noise])[:, None] * np.ones(len(moving))
    chi = residual @ solveh_banded(bands, residual, lower=True)
    now = (model.coulomb, model.viscous, model.stiffness, model.relaxation_rate, mass)
    then = (start.coulomb, start.viscous, start.stiffness, start.relaxation_rate, MASS)
    belief = SETTINGS.belief
    away = [
        (a / b - 1.0) / s if b else 0.0
        for a, b, s in zip(now, then, belief.start_spread, strict=False)
    ]
    return float(chi + np.square(away).sum())


@settings(max_examples=40, deadline=None, derandomize=True)
@given(truth=frictions, scale=scales, target=targets, sign=signs, seed=st.integers(0, 99))
@example(FrictionFigures(1, 1.0, 0.0, 3e6, 2e3, -0.3, 1e-2, 2.0), 2.5, 20e-3, -1.0, 0)
def test_the_answer_is_finite_bounded_and_no_worse_than_the_start(truth, scale, target, sign, seed):
    start = truth.scaled(scale)
    data, estimator = move(truth, sign * target, seed), knowing(start)
    estimate = estimator.update(data)
    low, high = BOUNDS
    for name in ("coulomb", "viscous", "stiffness", "relaxation_rate"):
        value, begun = getattr(estimate.friction, name), getattr(start, name)
        assert low * begun * (1 - 1e-9) <= value <= high * begun * (1 + 1e-9), name
        assert 0.0 <= estimate.sigma[name] < np.inf
        assert estimate.figures[name] == getattr(estimate.friction, name)
        assert estimate.gain[name] >= 1.0 - 1e-6
    assert np.isfinite(estimate.misfit)
    assert estimate.accepted == (estimate.reason is None)
    if not estimate.accepted:
        assert estimate.friction == start
        return
    before = cost(data, start, MASS, start)
    after = cost(data, estimate.friction, estimate.mass[0], start)
    # The zones' borders are the estimator's own: a sample more or less.
    assert after <= before * 1.01 + 2.0


@settings(max_examples=25, deadline=None, derandomize=True)
@given(truth=frictions, scale=scales, target=targets, seed=st.integers(0, 99))
def test_directions_are_mirror_images(truth, scale, target, seed):
    data = move(truth, target, seed)
    there = knowing(truth.scaled(scale)).update(data)
    mirrored = replace(data, position=-data.position, force=-data.force)
    back = knowing(truth.scaled(scale)).update(mirrored)
    assert there.accepted == back.accepted
    for name in ("coulomb", "stiffness", "viscous"):
        np.testing.assert_allclose(
            getattr(back.friction, name), getattr(there.friction, name), rtol=1e-6
        )


places = st.floats(0.0, 1.0)
unusable = st.tuples(places, st.integers(1, 30), st.sampled_from(["lost", "nan", "saturated"]))
# Nothing marks a kick: over all that slides it would be a force like any other.
kicks = st.tuples(places, st.integers(1, 12), st.just("kick"))


def first_update(start, data):
    """The estimate of a first move out of relaxed rest, and the estimator."""
    estimator = SplitHorizonEstimator(start, replace(SETTINGS, peak_force=150.0))
    estimator.at_rest(0.0, 0.0, 0.0)
    estimator.update(whole(np.zeros(5), np.zeros(5), 0.0))
    return estimator.update(data), estimator


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    truth=frictions, target=targets, seed=st.integers(0, 99),
    spoil=st.lists(unusable | kicks, min_size=1, max_size=4),
)  # fmt: skip
@example(FrictionFigures(1, 8.0, 20.0, 2.2e6, 190.0, 0.6, 2.5e-3, 2.0), 2e-6, 0, [(0.0, 4, "lost")])
@example(FrictionFigures(7, 21.0, 0.0, 2.8e6, 450.0, 0.69, 7e-3, 0.64), 2e-6, 9, [(0.0, 7, "lost")])
@example(
    FrictionFigures(2, 3.6, 30.0, 1.1e5, 21.0, -0.22, 1.8e-3, 1.1),
    6e-5,
    81,
    [(0.0, 28, "saturated")],
)
@example(
    FrictionFigures(10, 1.4, 6.7, 3.8e5, 19.0, 0.92, 4.5e-3, 1.6), 3e-3, 85, [(0.0, 15, "lost")]
)
@example(
    FrictionFigures(10, 24.0, 23.0, 1.1e6, 250.0, 0.91, 5e-3, 1.2), 0.02, 81, [(0.0, 14, "nan")]
)
@example(FrictionFigures(1, 14.0, 9.2, 1.4e6, 1500.0, 0.0, 5e-4, 0.6), 0.02, 5, [(0.0, 5, "nan")])
def test_bad_samples_never_make_a_wrong_update(truth, target, seed, spoil):
    data = move(truth, target, seed)
    force, valid = data.force.copy(), data.valid.copy()
    count = len(force)
    for place, length, kind in spoil:
        begin = 4 + int(place * (count - 5))  # the rest before the move is known
        part = slice(begin, begin + length)
        if kind == "lost":
            valid[part] = False
        elif kind == "nan":
            force[part] = np.nan
        elif kind == "saturated":
            force[part] = 200.0
        else:
            force[part] += 15.0
    if (valid & np.isfinite(force)).sum() < 3:
        return
    start = truth.scaled(0.9)
    estimate, estimator = first_update(start, replace(data, force=force, valid=valid))
    assert np.isfinite(list(estimate.sigma.values())).all()
    assert np.isfinite(estimator.state.forces).all()
    if not estimate.accepted:
        assert estimate.friction == start
        return
    # An accepted one is no farther off than the start was, or than without them, but for what its
    # sigma admits.
    good, _ = first_update(start, data)
    for name in ("coulomb", "stiffness"):
        true, sigma = getattr(truth, name), estimate.sigma[name]
        error, *others = (
            abs(getattr(model, name) - true) for model in (estimate.friction, start, good.friction)
        )
        assert error <= max(others) + 5 * sigma, name


@settings(max_examples=40, deadline=None, derandomize=True)
@given(friction=frictions, seed=st.integers(0, 999), size=st.floats(1e-7, 1e-2))
def test_element_forces_stay_within_their_limits(friction, seed, size):
    rng = np.random.default_rng(seed)
    x = size * np.cumsum(rng.normal(0.0, 0.3, 120))
    state = FrictionState.relaxed(friction.elements, float(x[0]))
    force, jacobian = follow(friction, state, x, np.gradient(x, TS), TS)
    most = friction.coulomb * max(1.0 + friction.static_ratio, 1.0)
    assert np.isfinite(jacobian).all()
    assert np.abs(force).max() <= most * (1 + 1e-9)
    limits = element_shares(friction.elements) * most
    assert (np.abs(state.forces) <= limits * (1 + 1e-9)).all()
