"""Which sites are due, and slipped into a production run."""

import re

from stagectl.calibration import DueSection, due_sites, insert_sites
from stagectl.calibration.due_sites import DueSite
from stagectl.calibration.sites import DAY
from stagectl.config.machine.file import load_machine
from stagectl.history import StepRecord, Wear
from stagectl.maps import load_active
from stagectl.recipe import MoveStep, parse_recipe
from stagectl.recipe.plan import plan
from tests.unit.stagectl.calibration.conftest import RECIPE, SITES
from tests.unit.stagectl.calls import count_calls
from tests.unit.stagectl.maps.conftest import GRID, activated, file, level
from tests.unit.stagectl.rows import BEGIN, STAGE, estimate_record, run_entry

DUE = DueSection(days=10, moves=100, distance=5.0)


def estimates(history, purpose, time, places, distance=0.01):
    number = history.start_run(run_entry(started=time, purpose=purpose))
    shown = {"kind": "other", "time": time, "distance": distance, "measured": (6.0, 0.02)}
    history.add([estimate_record(number, place=place, **shown) for place in places])
    return number


def test_work_grows_with_the_sites_and_not_with_their_square():
    class Calibrated:
        """A history in which all of these sites were calibrated at once."""

        def __init__(self, sites):
            self.calibrated = lambda stage: [(site, 1.7e9) for site in sites]
            self.steps = lambda stage, since: []
            self.wear = lambda *arguments: Wear(0, 0.0)

    def work(side):
        sites = [(0.005 * i, 0.005 * j) for i in range(side) for j in range(side)]
        return count_calls(
            lambda: due_sites(sites, DUE, Calibrated(sites), STAGE, ("x", "y"), 1.7e9 + 1, None)
        )

    assert work(20) < 5 * work(10)


def test_age_moves_distance_and_steps_make_a_site_due(history):
    now = 1.7e9

    def due(at):
        found = due_sites(SITES, DUE, history, STAGE, ("x", "y"), at, None)
        return {d.place: d.reasons for d in found}

    assert set(due(now)) == set(SITES)  # never calibrated
    estimates(history, "calibration", now, SITES[:3])
    assert set(due(now + 10)) == {SITES[3]}
    assert set(due(now + 10.5 * DAY)) == set(SITES)
    run = estimates(history, "production", now + 100, [SITES[0]] * 101, 1e-3)
    assert "101 moves since" in due(now + 200)[SITES[1]][0]
    estimates(history, "calibration", now + 300, SITES)
    assert due(now + 400) == {}
    estimates(history, "production", now + 500, [SITES[0]] * 6, 1.0)
    assert "6 m travelled" in due(now + 600)[SITES[2]][0]
    estimates(history, "calibration", now + 700, SITES)
    history.add_step(StepRecord(run, "x", SITES[2], now + 800, 0.2, "site"))
    assert due(now + 900) == {SITES[2]: ("x: stepped by +20 % since",)}
    history.add_step(StepRecord(run, "x", SITES[2], now + 850, 0.2, "common"))
    assert set(due(now + 900)) == set(SITES)


def test_change_and_uncertainty_make_sites_due(history):
    """What production has found off the map, and what the map does not know well any more."""
    sites = GRID[:6]
    activated(history, sites)
    file(history, BEGIN + 200, [
        ("x", "macro", i + 1, place, BEGIN + 200 + 10 * k + i, {"coulomb": 6.0},
         (level("x", place) * (1.06 if i == 4 else 1.0), 0.02))
        for k in range(8) for i, place in enumerate(sites)
    ])  # fmt: skip

    def due(now, **limits):
        places = load_active(history, STAGE, load_machine(), sites, now).places
        asked = DueSection.model_validate({"days": 1000, **limits})
        found = due_sites(sites, asked, history, STAGE, ("x", "y"), now, places)
        return {d.place: " ".join(d.reasons) for d in found}

    found = due(BEGIN + 300)
    assert set(found) == {sites[4]}
    assert re.fullmatch(r"x: \+[56]\.\d % off the map", found[sites[4]])
    assert due(BEGIN + 300, change=0.2) == {}
    assert due(BEGIN + 86400 * 30, change=0.2).keys() == set(sites)  # nobody has looked since
    assert all("uncertain by" in reason for reason in due(BEGIN + 300, uncertainty=1e-3).values())


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
