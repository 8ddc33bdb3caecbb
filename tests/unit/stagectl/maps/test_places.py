"""The active map in production."""

import numpy as np
import pytest

from stagectl.maps import TrackedPlaces
from tests.unit.stagectl.calls import count_calls
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, activated, estimate, level


def test_in_production_a_site_is_known_on_arrival_and_its_step_is_detected(history):
    unseen = (0.011, 0.009)
    active = activated(history, [unseen])
    assert active.version.number == 1
    assert active.figures["x"]["viscous"] == (20.0, pytest.approx(0.1**0.5))
    places, steps = active.places, []
    places.on_step = steps.append
    assert isinstance(places, TrackedPlaces)
    there = places.expected_at(unseen, 1.0)
    for axis, expected in zip("xy", there, strict=True):
        truth = level(axis, unseen)
        assert abs(expected.coulomb - truth) < 3 * expected.sigma + 0.02 * truth
    assert places.expected_at((unseen[0] + 1e-4, unseen[1]), 2.0) is None  # a micro-move stays
    path = np.linspace((-0.03, -0.02), unseen, 30)
    variation = places.coulomb_variation(0, path)
    truth = np.array([level("x", p) for p in path]) / level("x", unseen) - 1
    assert np.abs(variation - truth).max() < 0.03
    assert variation[-1] == pytest.approx(0.0, abs=1e-9)
    for k in range(3):  # settle the common level first
        for place in GRID[:5]:
            places.expected_at(place, 10.0 + k)
            places.learn(0, "macro", estimate((level("x", place), 0.02)), 10.0 + k)
    assert steps == []
    places.expected_at(GRID[12], 20.0)
    answer = places.learn(0, "macro", estimate((1.2 * level("x", GRID[12]), 0.02)), 20.5)
    assert [(s.axis, s.place, s.everywhere) for s in steps] == [("x", GRID[12], False)]
    assert answer.coulomb == pytest.approx(1.2 * level("x", GRID[12]), rel=0.04)


def test_sites_of_a_run_are_told_apart_without_comparing_each_with_each(mapped, machine):
    def work(count):
        sites = [(-0.06 + 0.004 * (i % 30), -0.06 + 0.004 * (i // 30)) for i in range(count)]
        return count_calls(lambda: TrackedPlaces(mapped.first.map, machine, sites, {}, BEGIN))

    assert work(200) < 3 * work(100)
