"""A machine, and a recipe text to change."""

from pathlib import Path

import pytest

from stagectl.errors import ConfigError
from stagectl.recipe import parse_recipe

HEAD = """recipe: a
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 50 nm, hold: 5 ms, timeout: 0.15}
"""
INSPECTION = Path(__file__).parents[4] / "recipes" / "inspection-20.yaml"


@pytest.fixture(scope="session")
def inspection():
    """The text of the recipe that the project ships."""
    return INSPECTION.read_text(encoding="utf-8")


@pytest.fixture
def recipe_of(machine):
    return lambda text: parse_recipe(text, "r.yaml", machine)


@pytest.fixture
def problems_of(machine):
    """The problems of a text, which must have some."""

    def problems(text, name="r.yaml"):
        with pytest.raises(ConfigError) as caught:
            parse_recipe(text, name, machine)
        assert all("\n" not in line for line in caught.value.problems)
        return caught.value.problems

    return problems
