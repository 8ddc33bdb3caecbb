"""Recipes that take longer than a recording can hold."""

import pytest

from estimation.trajectory import duration
from stagectl.recipe import Profile
from stagectl.recipe.duration_limit import minimum_duration
from tests.unit.stagectl.recipe.conftest import HEAD


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (
            "velocity: 0.5",
            "velocity: 1e-12",
            "a macro-move of 50 mm takes at least 1.39e+07 h, the",
        ),
        ("velocity: 0.01", "velocity: 1e-9", "a micro-move of 0.08 mm takes at least 22.2 h, the"),
        ("expose: 0.02", "expose: 3600", "takes at least 20 h, a recording holds 12 h"),
    ],
)
def test_sites_that_take_too_long_are_refused(inspection, problems_of, old, new, problem):
    (found,) = problems_of(inspection.replace(old, new))
    assert found.startswith(f"r.yaml:7:8: sites: {problem}")


def test_moves_that_take_too_long_are_refused(problems_of):
    text = HEAD + "moves: [{repeat: 9, moves: [{dwell: 5000}]}]\n"
    (problem,) = problems_of(text)
    assert problem.endswith("moves: takes at least 12.5 h, a recording holds 12 h")


def test_the_bound_is_below_the_duration_of_a_move_and_near_it():
    for distance in (1e-9, 1e-6, 8e-5, 1e-3, 0.05, 0.3):
        for profile in (Profile(0.5, 3.0, 200.0), Profile(0.01, 0.2, 20.0)):
            took = duration(distance, profile.velocity, profile.acceleration, profile.jerk)
            assert 0.5 * took < minimum_duration(distance, profile) <= took * (1 + 1e-9)
