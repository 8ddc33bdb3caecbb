"""The calibration file."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from stagectl.calibration import Calibration, DueSection, load_calibration
from stagectl.calibration.sites import repeated_sites
from stagectl.errors import ConfigError
from stagectl.recipe import MoveStep, parse_recipe
from stagectl.recipe.plan import plan
from tests.unit.stagectl.calibration.conftest import FILE, RECIPE, SITES

DUE = DueSection(days=10, moves=100, distance=5.0)


def test_every_site_is_visited_and_the_first_one_again(machine, sequence):
    text = RECIPE.format(", ".join(f"[{x}, {y}]" for x, y in SITES))
    recipe = replace(parse_recipe(text, "r.yaml", machine), excursions=sequence.excursions)
    recipe = Calibration(recipe, sequence, DUE, None).at(recipe.sites)
    steps = [s for s in plan(recipe) if isinstance(s, MoveStep)]
    macro = [s.target for s in steps if s.kind == "macro"]
    assert macro == [*SITES, SITES[0]]
    assert steps[-1].target == SITES[0]
    near = {s.site: [] for s in steps}
    for step in steps:
        near[step.site].append(math.dist(step.target, recipe.sites[step.site - 1]))
    assert all(max(distances) < 5e-3 for distances in near.values())


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("calibrate: c\n", "sites: is missing"),
        (FILE.replace("[0, 0]", "[0.15, 0]"), "outside the travel of axis x"),
        ("calibrate: c\nsites: [[0, 0], [0.01, 0], [0, 0]]\n", "site 3 is site 1 again"),
        (FILE + "due: {weeks: 1}\n", "due.weeks"),
        (FILE + "due: {days: -1}\n", "due.days"),
        (FILE + "reach: 2 kg\n", "reach"),
    ],
)
def test_an_error_in_the_file_names_its_place(machine, tmp_path, text, reason):
    path = tmp_path / "sites.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as refused:
        load_calibration(path, machine)
    assert reason in str(refused.value)
    assert "sites.yaml:" in str(refused.value)


def test_repeated_sites_name_the_first_one_there():
    assert repeated_sites(SITES) == []
    assert repeated_sites([*SITES, SITES[1], SITES[0], SITES[1]]) == [(5, 2), (6, 1), (7, 2)]


def test_a_grid_of_more_sites_than_a_recipe_may_have_is_refused_by_its_count(machine, tmp_path):
    path = tmp_path / "sites.yaml"
    grid = "{origin: [0, 0], pitch: [1.0e-5, 1.0e-5], count: [1000, 1000]}"
    path.write_text(f"calibrate: c\nsites: {{grid: {grid}}}\n")
    with pytest.raises(ConfigError, match="more than 100000 sites: 1000000") as refused:
        load_calibration(path, machine)
    assert len(refused.value.problems) == 1


def test_the_example_fits_the_packaged_machine(machine):
    path = Path(__file__).parents[4] / "recipes" / "calibration-9.yaml"
    assert len(load_calibration(path, machine).recipe.sites) == 9
