"""The kernel of the mechanics against the same steps written out in numpy."""

import numpy as np
import pytest

from hil_sim.plant import simulate
from hil_sim.plant.arrays import Arrays
from hil_sim.plant.stepped import Plant
from hil_sim.settings import SUBSTEPS
from tests.unit.hil_sim.inputs import OPEN, change_axes

TC, TS = 1e-4, 1e-3
MASS, VISCOUS, BANDWIDTH = 8.0, 20.0, 1500.0


@pytest.fixture
def open_loop(nominal):
    """No presliding to speak of, no control: the motor gets the force offset."""
    return change_axes(nominal, {"coulomb": 1e-12, "stiffness": 1e-9}, OPEN, increment=1e-13)


def semi_implicit(offset):
    """Position at every SYNC: five steps a tick, velocity first; current loop of first order."""
    dt = TC / SUBSTEPS
    gain = 1.0 - np.exp(-2.0 * np.pi * BANDWIDTH * dt)
    x = v = force = 0.0
    found, before = [], 0.0
    for demand in offset:
        found.append(x)
        for tick in range(1, 11):
            output = before + (demand - before) * tick / 10.0
            for _ in range(SUBSTEPS):
                force += gain * (output - force)
                v += dt / MASS * (force - VISCOUS * v)
                x += v * dt
        before = demand
    return np.array(found)


def test_every_tick_is_five_semi_implicit_steps_behind_a_first_order_current_loop(open_loop):
    offset = np.array([0.0, 3.0, -2.0, 5.0, 5.0, 0.0, -4.0, 1.0])
    pair = np.column_stack([offset, np.zeros_like(offset)])
    response = simulate(open_loop, np.zeros_like(pair), pair, None, rounded=False)
    expected = semi_implicit(offset)
    np.testing.assert_allclose(response.position[:, 0], expected, atol=1e-12)
    np.testing.assert_array_equal(response.position[:, 1], 0.0)


def test_a_command_is_a_linear_ramp_within_its_ticks(nominal):
    plant = Plant(nominal, None, start=(0.0, 0.0))
    for axis in (0, 1):
        plant.power(axis, True)
    plant.command(0, 1e-6, 0.0, 10)
    seen = []
    for tick in range(1, 13):
        plant.advance_to(tick * 100_000)
        seen.append(plant.demand(0))
    expected = np.minimum(np.arange(1, 13) / 10.0, 1.0) * 1e-6
    np.testing.assert_allclose(seen, expected, rtol=1e-12)
    assert plant.demand(1) == 0.0


def test_the_worst_following_error_is_of_the_ticks_since_it_was_asked_for(nominal):
    plant = Plant(nominal, None, start=(0.0, 0.0))
    plant.power(0, True)
    plant.command(0, 1e-3, 0.0, 1)
    plant.advance_to(200_000)
    assert plant.following_error(0) == pytest.approx(1e-3, rel=0.01)
    plant.command(0, plant.demand(0), 0.0, 1)
    plant.advance_to(100_000_000)
    plant.following_error(0)
    plant.advance_to(101_000_000)
    assert plant.following_error(0) < 1e-4


def test_friction_wanders_with_the_correlation_time_of_the_axis(nominal):
    """A Gauss-Markov factor: variance and decay do not depend on the control tick."""
    arrays = Arrays(nominal, (0.0, 0.0))
    for axis, record in zip(nominal.axes, arrays.plant, strict=True):
        keep = float(record["wander_keep"])
        assert keep == pytest.approx(np.exp(-TC / axis.correlation_time))
        assert float(record["wander"]) / np.sqrt(1.0 - keep**2) == pytest.approx(axis.wander)


def test_the_same_seed_makes_the_same_course_however_it_is_cut(nominal):
    """One SYNC at a time or one tick at a time: the noise belongs to the tick."""

    def run(step_ns):
        plant = Plant(nominal, 7, start=(0.0, 0.0))
        for axis in (0, 1):
            plant.power(axis, True)
        plant.command(0, 1e-6, 1.0, 20)
        for now in range(step_ns, 5_000_001, step_ns):
            plant.advance_to(now)
        return plant.encoder(0), plant.encoder(1), plant.force(0)

    assert run(100_000) == run(1_000_000) == run(5_000_000)
