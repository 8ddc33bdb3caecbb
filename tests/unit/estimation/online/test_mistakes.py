"""What is usually done wrong in on-line friction estimation, each with a test that would see it.

The list is that of the research behind the estimator; its numbers are in the tests' names. Where a
test elsewhere sees the mistake, it stands here only:

| mistake | test |
| --- | --- |
| 8 Euler steps of a fast relaxation overflow | test_gms: test_very_fast_relaxation_is_stable |
| 9 a sign dropped: one direction only | test_gms: test_both_directions_are_mirror_images |
| 10 noise at rest resets the slip flags | test_gms: test_encoder_noise_at_rest_moves_nothing |
| 17 (half) the arrival cost is no filter | test_least_squares: test_repeated_arrival_... |
| 21 a bound freezes a variable where it stands | test_least_squares: test_a_bound_that_is_hit... |
"""

from dataclasses import replace

import numpy as np
import pytest

from estimation.friction import FrictionState, follow
from estimation.friction.feedforward import friction_feedforward
from estimation.noise import quantisation
from estimation.offline import OfflineSettings, identify
from estimation.offline.records import Samples
from estimation.online.belief.belief import BeliefSettings
from estimation.online.estimator import EstimatorSettings, SplitHorizonEstimator
from estimation.online.solver.zones import SLIDE, split
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures
from tests.unit.estimation.online.moves import whole as data

TS, MASS, FINE = 1e-3, 8.0, 20
TRUE = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
MACRO, MICRO = Limits(0.5, 3.0, 60.0), Limits(0.01, 0.2, 20.0)
SETTINGS = EstimatorSettings(
    mass=MASS, period=TS, position_noise=1e-9, force_noise=quantisation(0.04),
    belief=BeliefSettings(wander=0.0),
)  # fmt: skip


def record(
    target=25e-3, limits=MACRO, model=TRUE, state=None, mass=MASS, rest=40, start=0.0, back=1e-6
):  # fmt: skip
    """Positions and forces of a move of the model itself, integrated 20 times finer, no noise."""
    motion = plan(start, start + target, limits)
    count = int(motion.duration / TS) + rest
    time = np.arange(-2 * FINE, count * FINE + 1) * TS / FINE
    after = np.clip(time - motion.duration, 0.0, None)
    x, v, a = motion.sample(time)
    # It overshoots, by a micrometre for one, and turns back.
    turn = 2 * np.pi * 25
    bump = np.sign(target) * back * np.sin(turn * after) ** 2 * np.exp(-after / 8e-3)
    x, v = x + bump, v + np.gradient(bump, TS / FINE)
    a = a + np.gradient(np.gradient(bump, TS / FINE), TS / FINE)
    state = FrictionState.relaxed(model.elements, float(x[0])) if state is None else state
    force, _ = follow(model, state, x, v, TS / FINE, 1, 0.0)
    return x[::FINE].copy(), (mass * a + model.viscous * v + force)[::FINE].copy()


def knowing(model=TRUE, settings=SETTINGS):
    """An estimator that knows the state at rest, so that the next move's onset counts."""
    relaxed = FrictionState.relaxed(model.elements)
    estimator = SplitHorizonEstimator(model, settings, state=relaxed)
    estimator.at_rest(0.0, 0.0, 0.0)
    return estimator


def noisy(position, force, seed, step=0.04):
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, step)
    seen = np.round((force + phase) / step) * step - phase
    return position + rng.normal(0.0, 1e-9, len(position)), seen


def test_01_force_and_position_off_their_common_instant():
    """Half a sample between them is -37 % of sigma_v at 1 kHz: aligned data must come back."""
    found = knowing(TRUE.scaled(0.5)).update(data(*record())).friction
    assert found.viscous == pytest.approx(20.0, rel=0.01)
    assert found.coulomb == pytest.approx(6.0, rel=0.002)


def test_01_a_lag_of_the_force_is_seen_on_an_s_curve():
    """A lag hides in Fc and sigma_v of a sine move; jerk-limited moves determine it."""
    position, force = record()
    late = np.interp(np.arange(len(force)) - 0.5, np.arange(len(force)), force)
    ones = np.ones(len(force), dtype=bool)
    settings = OfflineSettings(MASS, TS, 1e-9, 0.01, wander=1e-4, least=50)
    found = identify([Samples(position, late, ones, 0.0)], TRUE, settings)
    # Without setpoints the lag of friction and that of inertia share it.
    lag = found["lag"].value - found["ripple_lag"].value * TS
    assert lag == pytest.approx(0.5e-3, rel=0.1)


def test_02_and_03_no_filter_bends_the_onset():
    """V and a filtered but not u: sigma0 +33 %; cut-off too low: C on its bound."""
    sharp = record(limits=Limits(0.5, 3.0, 200.0))
    found = knowing(TRUE.scaled(0.5)).update(data(*sharp)).friction
    assert found.stiffness == pytest.approx(6e5, rel=0.02)


def test_04_the_ends_of_the_record_do_not_matter():
    """Forward-backward filters bend the ends: a longer rest behind must not change the answer."""
    position, force = record(rest=120)
    short, long = (knowing(TRUE.scaled(0.5)) for _ in range(2))
    cut = len(position) - 70
    a, b = short.update(data(position[:cut], force[:cut])), long.update(data(position, force))
    assert a.friction.stiffness == pytest.approx(b.friction.stiffness, rel=2e-3)
    assert a.friction.coulomb == pytest.approx(b.friction.coulomb, rel=2e-4)


@pytest.mark.parametrize("seed", range(5))
def test_05_the_border_is_late_not_early_under_noise(seed):
    """Sign of a noisy velocity: 1 ms early is +9 % of sigma0, 10 ms early -58 %; late is free."""
    position, _ = record()
    summit = int(np.argmax(position))
    noise = np.random.default_rng(seed).normal(0.0, 4e-9, len(position))
    zone = split(position + noise, TRUE, TS)
    fast = np.abs(np.gradient(position, TS))[1:-1] > 10.0 * TRUE.stribeck_velocity
    # Zone A ends where it is slow, never before; nothing slides after the summit.
    assert (zone[fast & (np.arange(len(zone)) > 100)] == SLIDE).all()
    assert not (zone[summit + 1 :] == SLIDE).any()


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_06_zone_a_is_entered_late_even_if_the_stiffness_is_wrong(scale):
    """Started before all elements slip: Fc -7 %, C 86 times too large."""
    believed = replace(TRUE, stiffness=6e5 * scale)
    estimator = SplitHorizonEstimator(believed, SETTINGS)
    estimator.at_rest(0.0, 0.0, 0.0)
    estimate = estimator.update(data(*record()))
    assert estimate.friction.coulomb == pytest.approx(6.0, rel=0.005)


def test_07_sticking_elements_follow_positions_not_velocities():
    """DF = k sigma0 v h is 33 to 357 mN off at 1 kHz: velocity must not matter while sticking."""
    x = 0.5e-6 * np.sin(np.arange(200) * 0.3)
    for velocity in (np.gradient(x, TS), np.zeros(200), np.full(200, 1e-4)):
        force, _ = follow(TRUE, FrictionState.relaxed(4), x, velocity, TS, 4, 0.0)
        np.testing.assert_allclose(force, 6e5 * x, atol=1e-9)


def test_11_a_limit_that_falls_below_the_force_starts_the_slip():
    """A two-sided test for the limit misses one that falls with rising speed."""
    one = replace(TRUE, elements=1, static_ratio=0.5)
    state = FrictionState(np.array([8.5]), np.array([False]), np.array([1.0, 0.0]))
    # Held at 8.5 N, between Fc = 6 and Fs = 9; then fast at once: the limit is 6.
    x = 1e-4 * np.arange(1, 200)
    force, _ = follow(one, state, x, np.full(199, 0.1), TS)
    assert state.slipping.all()
    assert (np.diff(force) < 1e-12).all()
    assert force[-1] == pytest.approx(6.0, rel=1e-6)


def test_12_zone_a_knows_the_elements_by_their_sum_only():
    """Their forces free one by one in zone A: rank 1 of N, the others are noise."""
    found = []
    for forces in ([0.4, 0.4, 0.4, 0.4], [-0.6, -0.4, 0.2, 2.4]):
        estimator = SplitHorizonEstimator(TRUE.scaled(0.8), SETTINGS)
        estimator.at_rest(0.0, 1.6, 0.0)
        estimator.state.forces[:] = forces
        start = FrictionState(np.full(4, 0.4), np.zeros(4, dtype=bool), np.array([0.0, 0.0]))
        estimate = estimator.update(data(*record(state=start), rest_force=1.6))
        found.append(estimate.friction.coulomb)
    assert found[0] == pytest.approx(found[1], rel=5e-3)


def test_13_a_fast_move_does_not_move_c():
    """C and alpha from one move: bounds of 500 %; whatever a fast move says of C is model error."""
    estimator = knowing(replace(TRUE, relaxation_rate=130.0))
    estimate = estimator.update(data(*record()))
    assert estimate.friction.relaxation_rate == pytest.approx(130.0, rel=0.05)
    assert estimate.gain["relaxation_rate"] < 1.5


def test_14_sigma_is_the_sensors_not_the_residuals():
    """MSE (J'J)^-1 is 6 to 18 times too wide, or 0.3 to 0.9 times too narrow."""
    position, force = record()
    clean = knowing().update(data(position, force))
    loud = knowing().update(data(*noisy(position, force, 1)))
    assert loud.misfit > 1.2 * clean.misfit
    for name in ("coulomb", "viscous", "stiffness"):
        assert loud.sigma[name] == pytest.approx(clean.sigma[name], rel=0.1)


def test_15_force_steps_leave_no_bias_beyond_sigma():
    """Rounding taken for white noise: sigma0 +24 % from 50 samples."""
    position, force = record()
    away = []
    for seed in range(25):
        estimate = knowing(TRUE.scaled(0.9)).update(data(*noisy(position, force, seed)))
        assert estimate.accepted
        away.append((estimate.friction.stiffness - 6e5) / estimate.sigma["stiffness"])
    assert abs(np.mean(away)) < 1.0
    assert np.std(away) < 2.0


def test_16_too_little_motion_leaves_the_stiffness_in_its_prior():
    """Good tracking moves 0.3 um in zone B: without a prior sigma0 ends on a bound."""
    settings = replace(SETTINGS, force_noise=quantisation(0.05))
    for seed in range(10):
        estimator = knowing(TRUE, settings)
        position, force = noisy(*record(0.3e-6, MICRO), seed, step=0.05)
        estimator.update(data(position, force))
        assert estimator.friction.stiffness == pytest.approx(6e5, rel=0.8)
        assert 0.1 * 6e5 < estimator.friction.stiffness < 10 * 6e5


def test_16_a_settling_of_nanometres_without_an_onset_does_not_determine_the_stiffness():
    """A first move that is followed well: a quarter of sigma0 fitted it, to 3 %."""
    estimator = SplitHorizonEstimator(TRUE, SETTINGS)
    estimator.at_rest(0.0, 0.0, 0.0)
    estimate = estimator.update(data(*record(back=30e-9)))
    assert estimate.accepted
    assert "stiffness" in estimate.held
    assert estimator.friction.stiffness == pytest.approx(6e5, rel=1e-3)


def test_17_certainty_has_a_floor_and_drift_is_followed():
    """No process noise: after many moves the estimate no longer follows the stage."""
    estimator = knowing(TRUE)
    target = 25e-3
    for number in range(12):
        worn = replace(TRUE, coulomb=6.0 if number < 8 else 6.25)
        estimator.update(data(*record(target, model=worn), 1.0 + number))
        estimator.at_rest(0.0, 0.0, 1.5 + number)
    assert estimator.friction.coulomb == pytest.approx(6.25, rel=0.01)
    # What one move alone would say is not divided by the number of moves.
    assert estimator.sigma["stiffness"] > 0.2 * knowing().update(data(*record())).sigma["stiffness"]


def test_18_the_state_at_rest_is_handed_over():
    """Restarting the elements at zero costs more than halving all figures."""
    state = FrictionState.relaxed(4)
    position, _ = record(state=state, rest=120)
    before, at = state.total, float(position[-1])
    state.settle_at(at)
    back = plan(at, at - 60e-6, MICRO)
    samples = int(back.duration / TS)
    carried = friction_feedforward(TRUE, state, back, samples, TS, 0.0)
    reset = friction_feedforward(TRUE, FrictionState.relaxed(4), back, samples, TS, 0.0)
    _, truth = record(-60e-6, MICRO, state=state.copy(), start=at)
    inertia = MASS * back.sample(np.arange(1, samples + 1) * TS)[2]
    needed = truth[3 : 3 + samples] - before - inertia
    good, bad = np.abs(carried - needed).max(), np.abs(reset - needed).max()
    assert good < 0.05
    assert bad > 2.0


def test_19_state_and_figures_change_together():
    """New figures with the old state: the next prediction starts at the wrong force."""
    position, force = record()
    estimator = knowing(TRUE.scaled(0.5))
    assert estimator.update(data(position, force)).accepted
    assert estimator.state.total == pytest.approx(force[-1], abs=0.1)


@pytest.mark.parametrize("sure", [False, True])
def test_19_elements_followed_with_wrong_figures_are_not_known(sure):
    """After a disturbed move at half of all figures, the next onset begins nobody knows where."""
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), SETTINGS, state=FrictionState.relaxed(4))
    estimator.at_rest(0.0, 0.0, 0.0)
    if sure:
        figures = {"coulomb": 6.0, "viscous": 20.0, "stiffness": 6e5}
        estimator.believe({name: (value, 0.02 * value) for name, value in figures.items()})
    state = FrictionState.relaxed(4)
    position, force = record(state=state)
    disturbed = force + 3.0 * np.sin(np.arange(len(force)))
    assert not estimator.update(data(position, disturbed)).accepted
    state.settle_at(float(position[-1]))
    rest = state.total
    estimator.at_rest(float(position[-1]), rest, 1.9)
    back = record(-30e-6, MICRO, state=state, start=float(position[-1]))
    estimate = estimator.update(data(*back, 2.0, rest))
    assert estimate.accepted == sure
    if sure:
        assert estimate.friction.stiffness == pytest.approx(6e5, rel=0.03)


def test_19_micro_moves_alone_are_learned_from_in_the_end():
    """... but an axis that only makes short moves, one of them disturbed, is not given up."""
    estimator = SplitHorizonEstimator(TRUE.scaled(0.7), SETTINGS)
    state, at, rest = FrictionState.relaxed(4), 0.0, 0.0
    accepted = []
    for number in range(8):
        estimator.at_rest(at, rest, number + 0.9)
        way = 80e-6 if number % 2 == 0 else -80e-6
        position, force = record(way, MICRO, state=state, start=at)
        seen = force + 3.0 * np.sin(np.arange(len(force))) if number == 1 else force
        accepted.append(estimator.update(data(position, seen, number + 1.0, rest)).accepted)
        at, rest = float(position[-1]), state.total
        state.settle_at(at)
    assert accepted[-2:] == [True, True]
    assert estimator.friction.coulomb == pytest.approx(6.0, rel=0.05)


def test_20_each_figure_is_forgotten_at_its_own_pace():
    """Fc and sigma_v drift with temperature, sigma0 and the shape mostly do not."""
    estimator = SplitHorizonEstimator(TRUE, SETTINGS)
    estimator.at_rest(0.0, 0.0, 0.0)
    rest = data(np.zeros(5), np.zeros(5), 0.0)
    before = estimator.update(rest).sigma
    after = estimator.update(rest).sigma
    grown = {name: np.sqrt(after[name] ** 2 - before[name] ** 2) for name in before}
    figures = {"coulomb": 6.0, "viscous": 20.0, "stiffness": 6e5, "relaxation_rate": 100.0}
    pace = {name: grown[name] / value for name, value in figures.items()}
    assert all(0.0 < drift < 0.02 for drift in pace.values())
    assert pace["viscous"] > pace["coulomb"]


def test_22_it_iterates_until_the_step_is_small():
    """Cost flat after one step: an answer that still depends on the start."""
    found = []
    for scale in (0.5, 0.8, 1.3, 2.0):
        wide = replace(
            SETTINGS,
            belief=BeliefSettings(tuple(9.0 for _ in SETTINGS.belief.start_spread), wander=0.0),
        )
        found.append(knowing(TRUE.scaled(scale), wide).update(data(*record())))
    for name in ("coulomb", "viscous", "stiffness"):
        values = [getattr(e.friction, name) for e in found]
        assert np.ptp(values) < 0.2 * found[0].sigma[name], name


def test_23_nothing_is_compiled_in_the_first_gap():
    """A compiler inside the first move's pause takes seconds."""
    from estimation.online import update
    from stagectl.config import load_machine
    from stagectl.sequencer import Mode, make_compensation

    kernels = [k for k in vars(update).values() if hasattr(k, "nopython_signatures")]
    axis = make_compensation(load_machine(), Mode.ESTIMATED)[0]
    compiled = [len(k.nopython_signatures) for k in kernels]
    assert sum(compiled) > 0
    axis.estimator.at_rest(0.0, 0.0, 0.0)
    for number in range(2):
        assert axis.learn(data(*record(), 1.0 + number)) is not None
    assert [len(k.nopython_signatures) for k in kernels] == compiled


@pytest.mark.parametrize("ratio", [0.96, 1.04])
def test_24_a_wrong_mass_does_not_bend_the_friction(ratio):
    """Mass is the best known of all figures: fixed at a wrong value it biases sigma_v and Fc."""
    estimator = knowing(TRUE, replace(SETTINGS, mass=MASS * ratio))
    estimate = estimator.update(data(*record()))
    assert estimate.accepted
    assert estimate.mass[0] == pytest.approx(MASS, rel=0.002)
    assert estimate.friction.viscous == pytest.approx(20.0, rel=0.01)
