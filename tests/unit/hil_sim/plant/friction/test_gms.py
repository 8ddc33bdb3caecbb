"""The plant's friction against closed forms."""

import math

import numpy as np
import pytest

from hil_sim.plant import Slip, element_shares, slip_step, stribeck


def drive(positions, *, elements=1, coulomb=2.0, stiffness=1e5, alpha=0.0, rate=100.0, dt=1e-5):
    """Total element force after each position, moved to with constant velocity in dt."""
    forces, slipping = np.zeros(elements), np.zeros(elements, dtype=np.bool_)
    shares = element_shares(elements)
    total, previous, heading = 0.0, positions[0], 0.0
    out = []
    for position in positions[1:]:
        dx = position - previous
        previous = position
        if dx != 0.0:
            direction = math.copysign(1.0, dx)
            if direction != heading:
                heading = direction
                slipping[:] = False
            curve = stribeck(dx / dt, alpha, 2e-3, 1.0)
            total = slip_step(
                forces, slipping, shares,
                Slip(direction, dx, coulomb * curve, math.exp(-rate * dt / curve)),
                stiffness / elements, elements,
            )  # fmt: skip
        out.append(total)
    return np.array(out)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_element_is_a_spring_until_it_slips(sign):
    x = sign * np.linspace(0.0, 40e-6, 401)
    force = drive(x)
    expected = sign * np.minimum(np.abs(x[1:]) * 1e5, 2.0)
    np.testing.assert_allclose(force, expected, rtol=1e-12, atol=1e-12)


def test_elements_slip_one_after_the_other():
    # With all of them stuck the stiffness is sigma0; when all slip the force is Fc.
    force = drive(np.linspace(0.0, 200e-6, 2001), elements=10)
    assert force[0] == pytest.approx(1e5 * 1e-7)
    assert force[-1] == pytest.approx(2.0)
    steps = np.diff(force)
    assert (steps > -1e-12).all()
    assert (np.diff(steps) < 1e-12).all()  # the curve only bends down


def test_hysteresis_closes_and_is_point_symmetric():
    step = 0.25e-6
    up = step * np.arange(-160, 161)
    down = up[::-1]
    lap = np.concatenate([up[1:], down[1:]])
    force = drive(np.concatenate([up[:1], lap, lap, lap]), elements=4)
    first, second, third = np.split(force, 3)
    np.testing.assert_allclose(third, second, atol=1e-12)
    rising, falling = second[: len(up) - 1], second[len(up) - 1 :]
    np.testing.assert_allclose(rising, -falling, atol=1e-12)
    assert np.trapezoid(rising, dx=step) - np.trapezoid(falling[::-1], dx=step) > 0  # dissipates
    assert np.abs(first - second).max() > 0.1  # the virgin curve is another one


def test_slip_relaxes_exponentially_to_the_new_level():
    # Static level at rest speed, then a fast slide: F - Fc decays with rate C/Fc.
    forces, slipping = np.array([3.0]), np.array([True])
    rate, dt = 80.0, 1e-4
    slip = Slip(1.0, 1e-4, 2.0, math.exp(-rate * dt))
    values = [slip_step(forces, slipping, np.array([1.0]), slip, 1e5, 1) for _ in range(200)]
    time = dt * np.arange(1, 201)
    np.testing.assert_allclose(values, 2.0 + 1.0 * np.exp(-rate * time), rtol=1e-12)


def test_a_limit_that_falls_below_the_force_is_approached_not_jumped_to():
    forces, slipping = np.array([3.0]), np.array([False])
    slip = Slip(1.0, 1e-9, 2.0, math.exp(-0.01))
    after = slip_step(forces, slipping, np.array([1.0]), slip, 1e5, 1)
    assert after == pytest.approx(2.0 + math.exp(-0.01), rel=1e-9)


def test_slip_ends_when_the_direction_changes():
    x = np.concatenate([np.linspace(0, 40e-6, 41), np.linspace(40e-6, 35e-6, 6)[1:]])
    force = drive(x)
    assert force[39] == pytest.approx(2.0)
    assert force[-1] == pytest.approx(2.0 - 5e-6 * 1e5)
