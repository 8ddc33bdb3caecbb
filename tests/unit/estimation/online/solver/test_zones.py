"""Zones of moves."""

import numpy as np

from estimation.online.solver.zones import REST, SLIDE, STICK, split
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

TS = 1e-3
TRUE = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)


def move(target, limits=(0.5, 3.0, 200.0), rest=60, noise=1e-9):
    motion = plan(0.0, target, Limits(*limits))
    time = np.arange(-5, int(motion.duration / TS) + rest) * TS
    rng = np.random.default_rng(1)
    return motion.sample(time)[0] + rng.normal(0.0, noise, len(time))


def test_a_micro_move_has_no_zone_a():
    zone = split(move(60e-6, (0.01, 0.2, 20.0)), TRUE, TS)
    assert not (zone == SLIDE).any()
    assert (zone == STICK).sum() > 20


def test_zone_a_ends_at_the_first_reversal():
    x = move(25e-3)
    peak = np.argmax(x > 12e-3)
    x[peak:] = 2 * x[peak] - x[peak:]  # turns back in the middle
    zone = split(x, TRUE, TS)
    assert np.flatnonzero(zone == SLIDE)[-1] <= peak
    assert (zone[peak : peak + 20] == STICK).all()


def test_noise_at_rest_is_no_motion():
    noise = np.random.default_rng(0).normal(0, 1e-9, 300)
    assert (split(noise, TRUE, TS) == REST).all()
    assert (split(np.zeros(10), TRUE, TS) == REST).all()
