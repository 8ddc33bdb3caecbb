"""Limits of the machine that every part of a recipe is checked against."""

import pytest

from stagectl.config import load_machine, parse_machine
from stagectl.errors import ConfigError
from stagectl.recipe import parse_recipe


def test_an_acceleration_beyond_the_drive_is_refused(inspection):
    text = load_machine().text.replace("mass: 8.0", "mass: 48.0")
    with pytest.raises(ConfigError) as caught:
        parse_recipe(inspection, "r.yaml", parse_machine(text, "m.yaml"))
    (problem,) = caught.value.problems
    assert "macro.acceleration: 3 takes 144 N on axis x, whose drive has 120 N at most" in problem
