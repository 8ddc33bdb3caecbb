"""One move as a least-squares problem: derivatives, whitening, what the noise does to it."""

import numpy as np
import pytest

from estimation.belief import LEVEL
from estimation.gms import Friction, FrictionState, element_shares, follow
from estimation.trajectory import Limits, plan
from estimation.window import normal_equations
from estimation.zones import STICK, differences, mark_zones

TS = 1e-3
TRUE = Friction(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
MASS = 8.0
FIGURES = np.array([6.0, 20.0, 6e5, 100.0, MASS])


def record(target=25e-3, limits=(0.5, 3.0, 200.0), rest=30, sub=20):
    """Position and force of a move of the model itself, integrated 20 times finer."""
    motion = plan(0.0, target, Limits(*limits))
    count = int(motion.duration / TS) + rest
    time = np.arange(-2 * sub, count * sub + 1) * TS / sub
    x, v, a = motion.sample(time)
    force, _ = follow(TRUE, FrictionState.relaxed(4), x, v, TS / sub, 1, 0.0)
    return x[::sub].copy(), (MASS * a + TRUE.viscous * v + force)[::sub].copy()


def problem(position, force, position_noise=0.0, force_noise=0.01):
    count = len(position) - 2
    velocity, acceleration = np.empty(count), np.empty(count)
    usable, zone = np.empty(count, dtype=bool), np.zeros(count, dtype=np.int8)
    differences(position, np.ones(len(position), bool), TS, velocity, acceleration, usable)
    mark_zones(position, velocity, TRUE.breakaway_travel, TRUE.stribeck_velocity, zone)
    constants = np.array([TS, MASS, position_noise, force_noise, 0.0, 0.0, 0.5, 0.05, 20.0, np.inf])
    return (
        position, velocity, acceleration, force, usable, zone, constants, FIGURES, TRUE.vector(),
        element_shares(4), 6.0, np.zeros(4), np.zeros(4, dtype=bool), 0.0, 0.0,
    )  # fmt: skip


def evaluate(data, p, knots=0, white=1e-4):
    active = np.arange(LEVEL + knots)
    curvature, slope = np.empty((len(active), len(active))), np.empty(len(active))
    chi, used = normal_equations(p, active, STICK, knots, white, data, curvature, slope)
    return chi, used, slope, curvature


@pytest.mark.parametrize("knots", [0, 3])
def test_slope_is_half_the_derivative_of_chi_square(knots):
    data = problem(*record(), position_noise=1e-9)
    p = np.concatenate([[1.02, 0.97, 1.03, 1.02, 1.001], np.full(knots, 0.004)])
    _, _, slope, _ = evaluate(data, p, knots)
    for i in range(len(p)):
        step = 1e-6
        above, below = p.copy(), p.copy()
        above[i] += step
        below[i] -= step
        numeric = (evaluate(data, above, knots)[0] - evaluate(data, below, knots)[0]) / (4 * step)
        # The elements' breakaways are kinks: the derivative of one sample may jump there.
        assert slope[i] == pytest.approx(numeric, rel=0.05, abs=1e-3 * np.abs(slope).max())


def test_whitening_is_that_of_the_covariance_of_second_differences():
    # Against a dense Cholesky factor of m^2 sx^2/Ts^4 D2 D2' + su^2 I.
    data = problem(*record(), position_noise=2e-9)
    p = np.array([1.1, 1.0, 1.0, 1.0, 1.0])
    white, noise = 1e-4, (MASS * 2e-9 / TS**2) ** 2
    chi, used, _, _ = evaluate(data, p, white=white)
    plain = problem(*record(), position_noise=0.0)
    zone = data[5]
    moving = np.flatnonzero(zone > 0)
    assert used == len(moving)
    assert (np.diff(moving) == 1).all()
    # Residuals one by one: chi-square of the first k samples, unwhitened, differs by r_k^2.
    residual = []
    for k in moving:
        only = zone.copy()
        only[:] = 0
        only[k] = STICK
        single = (*plain[:5], only, *plain[6:])
        chi_k, _, slope, _ = evaluate(single, p, white=1.0)
        # Its sign from the viscous column: r J / |J| with J = v figures.
        velocity = plain[1][k]
        sign = np.sign(slope[1] * velocity) if velocity != 0 else 1.0
        residual.append(sign * np.sqrt(chi_k))
    difference = np.zeros((used, used + 2))
    for i in range(used):
        difference[i, i : i + 3] = [1.0, -2.0, 1.0]
    covariance = noise * difference @ difference.T + white * np.eye(used)
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), np.array(residual))
    assert chi == pytest.approx(float(whitened @ whitened), rel=2e-3)


def test_masked_samples_do_not_count():
    data = problem(*record())
    usable = data[4].copy()
    usable[60:80] = False
    spoiled = data[3].copy()
    spoiled[62:80] = 1e6
    holed = (*data[:3], spoiled, usable, *data[5:])
    p = np.ones(5)
    chi, used, _, _ = evaluate(holed, p)
    full, all_used, _, _ = evaluate(data, p)
    assert used == all_used - 20
    assert chi <= full


def test_chi_square_of_noise_is_the_number_of_samples():
    position, force = record(limits=(0.5, 3.0, 40.0))  # soft corners: differences are exact
    rng = np.random.default_rng(5)
    ratios = []
    for _ in range(20):
        noisy = position + rng.normal(0.0, 1e-9, len(position))
        measured = force + rng.normal(0.0, 0.02, len(force))
        data = problem(noisy, measured, position_noise=1e-9)
        chi, used, _, _ = evaluate(data, np.ones(5), white=0.02**2)
        ratios.append(chi / used)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
