"""Sites: order, travel, and a line for each that cannot be visited."""

from stagectl.recipe import NoMark
from tests.unit.stagectl.recipe.conftest import HEAD


def test_raster_order_starts_each_row_at_the_same_side(inspection, recipe_of):
    recipe = recipe_of(inspection.replace("serpentine", "raster"))
    assert recipe.sites[5] == (-0.05, -0.025)


def test_every_listed_site_outside_has_its_own_line(problems_of):
    text = HEAD + "expose: 0\nfiducial: {source: none}\nsites:\n- [0, 0]\n- [0.2, 0]\n- [0, -1]\n"
    assert problems_of(text) == (
        "r.yaml:9:3: sites[2]: site 2: 0.2 m is outside the travel -0.15 ... 0.15 m of axis x",
        "r.yaml:10:3: sites[3]: site 3: -1 m is outside the travel -0.15 ... 0.15 m of axis y",
    )


def test_a_site_at_the_very_edge_is_inside_without_a_fiducial(recipe_of):
    recipe = recipe_of(HEAD + "expose: 0\nfiducial: {source: none}\nsites: [[0.15, -0.15]]\n")
    assert recipe.sites == ((0.15, -0.15),)
    assert recipe.fiducial == NoMark()


def test_thousands_of_problems_are_counted_not_listed(problems_of):
    found = problems_of(HEAD + "moves:\n" + "- {too: 1}\n" * 5000)
    assert len(found) == 101
    assert found[-1] == "r.yaml: and 4900 more problems"
