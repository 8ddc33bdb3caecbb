"""Sites slipped into a production run."""

from stagectl.calibration import insert_sites
from stagectl.calibration.due_sites import DueSite
from stagectl.recipe import MoveStep, parse_recipe
from stagectl.recipe.plan import plan
from tests.unit.stagectl.calls import count_calls

RECIPE = (
    "recipe: r\nmacro: {{velocity: 0.5, acceleration: 3.0, jerk: 200.0}}\n"
    "micro: {{velocity: 0.01, acceleration: 0.2, jerk: 20.0}}\n"
    "settle: {{window: 5.0e-8, hold: 0.005, timeout: 0.15}}\nexpose: 0\n"
    "sites: [{}]\nfiducial: {{source: none}}\n"
)


def test_due_sites_are_slipped_in_within_the_budget(machine, sequence):
    recipe = parse_recipe(RECIPE.format("[0, 0], [0.03, 0], [0.03, 0.03]"), "r.yaml", machine)
    due = [DueSite((0.03, 0.028), ("old",), 3.0), DueSite((0.0, 0.001), ("old",), 2.0)]
    one = sequence.duration
    made, spent = insert_sites(recipe, due, sequence, 1.6 * one)
    assert made.slipped == ((3, (0.03, 0.028)),)
    assert one < spent <= 1.6 * one
    both, spent = insert_sites(recipe, due, sequence, 4 * one)
    assert dict(both.slipped) == {3: (0.03, 0.028), 1: (0.0, 0.001)}
    visited = [s.target for s in plan(both) if isinstance(s, MoveStep) and s.kind == "macro"]
    assert visited == [(0.0, 0.0), (0.0, 0.001), (0.03, 0.0), (0.03, 0.03), (0.03, 0.028)]
    none, spent = insert_sites(recipe, due, sequence, 0.5 * one)
    assert (none, spent) == (recipe, 0.0)


def test_work_grows_with_the_due_sites_and_not_with_those_of_production_too(machine, sequence):
    def work(count):
        sites = ", ".join(f"[{0.0001 * i:.4f}, 0]" for i in range(count))
        recipe = parse_recipe(RECIPE.format(sites), "r.yaml", machine)
        due = [DueSite((0.0, 0.001), ("old",), 2.0)]
        return count_calls(lambda: insert_sites(recipe, due, sequence, 100.0))

    assert work(400) == work(100)
