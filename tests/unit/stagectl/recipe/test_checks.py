"""Limits of the machine that every part of a recipe is checked against."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError
from stagectl.recipe import parse_recipe

Problems = Callable[..., tuple[str, ...]]


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            "window: 5.0e-8",
            "window: 2 m",
            "settle.window: 2 m is never exceeded: axis x faults at 0.001 m "
            "(limits.following_error)",
        ),
        (
            "timeout: 0.15",
            "timeout: 1.0e+9",
            "settle.timeout: 1e+09 s is longer than the longest move, 3600 s",
        ),
    ],
)
def test_a_threshold_that_nothing_can_exceed_is_refused(
    problems_of: Problems, inspection: str, old: str, new: str, line: str
) -> None:
    (problem,) = problems_of(inspection.replace(old, new))
    assert problem.endswith(line)


def test_an_acceleration_beyond_the_drive_is_refused(inspection: str) -> None:
    text = load_machine().text.replace("mass: 8.0", "mass: 48.0")
    with pytest.raises(ConfigError) as caught:
        parse_recipe(inspection, "r.yaml", parse_machine(text, "m.yaml"))
    (problem,) = caught.value.problems
    assert "macro.acceleration: 3 takes 144 N on axis x, whose drive has 120 N at most" in problem
