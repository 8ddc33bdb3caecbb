"""Rates of change learned from a history."""

import math

import numpy as np

from stagectl.maps.learning import figure_drift
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, STAGE, file


def test_drift_is_learned_per_axis_and_figure(history):
    """Viscous friction of x walks by 3 % a root day; that of y, and stiffness, stand still."""
    generator = np.random.default_rng(3)
    places, days = GRID[:6], 12
    walk = {
        axis: rate * generator.standard_normal((days, 6)).cumsum(axis=0)
        for axis, rate in (("x", 0.03), ("y", 0.0))
    }
    for day in range(days):
        at = BEGIN + day * 86400.0
        rows = [
            (axis, "other", i + 1, place, at + i,
             {"coulomb": 6.0, "viscous": 20.0 * math.exp(walk[axis][day, i]), "stiffness": 7e5},
             (6.0, 0.02))
            for i, place in enumerate(places) for axis in "xy"
        ]  # fmt: skip
        file(history, at, rows, "calibration")
    drift = figure_drift(history, STAGE, ("x", "y"))
    assert set(drift["x"]) == {"viscous", "stiffness"}  # the Coulomb force is the tracking's
    gap = 1.0 / 86400.0  # a day's walk, in the second from one move to the next
    assert drift["x"]["viscous"] > 0.02 * gap**0.5
    assert drift["x"]["viscous"] > 3 * max(drift["y"]["viscous"], drift["x"]["stiffness"])
    assert figure_drift(history, STAGE, ("z",)) == {}
