"""Recipes that take longer than a recording can hold."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from estimation.trajectory import duration
from stagectl.recipe import Profile
from stagectl.recipe.duration_limit import minimum_duration
from tests.unit.stagectl.recipe.conftest import HEAD

Problems = Callable[..., tuple[str, ...]]


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (
            "velocity: 0.5", "velocity: 1e-12",
            "r.yaml:7:8: sites: a macro-move of 50 mm takes at least 1.39e+07 h, the limit is 1 h",
        ),
        (
            "velocity: 0.01", "velocity: 1e-9",
            "r.yaml:7:8: sites: a micro-move of 0.08 mm takes at least 22.2 h, the limit is 1 h",
        ),
        (
            "expose: 0.02", "expose: 3600",
            "r.yaml:7:8: sites: takes at least 20 h, a recording holds 12 h",
        ),
    ],
)  # fmt: skip
def test_sites_that_take_too_long_are_refused(
    inspection: str, problems_of: Problems, old: str, new: str, problem: str
) -> None:
    assert problems_of(inspection.replace(old, new)) == (problem,)


def test_moves_that_take_too_long_are_refused(problems_of: Problems) -> None:
    text = HEAD + "moves: [{repeat: 9, moves: [{dwell: 5000}]}]\n"
    (problem,) = problems_of(text)
    assert problem.endswith("moves: takes at least 12.5 h, a recording holds 12 h")


def test_the_bound_is_below_the_duration_of_a_move_and_near_it() -> None:
    for distance in (1e-9, 1e-6, 8e-5, 1e-3, 0.05, 0.3):
        for profile in (Profile(0.5, 3.0, 200.0), Profile(0.01, 0.2, 20.0)):
            took = duration(distance, profile.velocity, profile.acceleration, profile.jerk)
            assert 0.5 * took < minimum_duration(distance, profile) <= took * (1 + 1e-9)
