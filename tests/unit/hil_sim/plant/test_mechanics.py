"""What the mechanics keep from tick to tick: following error, wandering friction, noise."""

import numpy as np
import pytest

from hil_sim.plant.arrays import Arrays
from hil_sim.plant.stepped import Plant


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
        assert keep == pytest.approx(np.exp(-1e-4 / axis.correlation_time))
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
