"""Calibrations: the file, what a sequence will teach, which sites are due, what fits into a run."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from stagectl.calibration import (
    Calibration,
    DueSection,
    SiteSequence,
    due_sites,
    load_calibration,
    outcomes,
    slip_in,
    visited,
)
from stagectl.calibration.due import DueSite
from stagectl.calibration.sequence import GOALS, START
from stagectl.calibration.sites import DAY
from stagectl.config.machine_file import load_machine
from stagectl.errors import ConfigError
from stagectl.history import EstimateRecord, RunEntry, StageKey, StepRecord, open_history
from stagectl.maps import AxisChange
from stagectl.maps.compare import SiteChange
from stagectl.recipe import Excursion, MoveStep, Profile, parse_recipe, plan

STAGE = StageKey("wafer-xy", True)
SITES = ((0.0, 0.0), (0.02, 0.0), (0.02, 0.02), (0.0, 0.02))
DUE = DueSection(days=10, moves=100, distance=5.0)
RECIPE = (
    "recipe: r\nmacro: {{velocity: 0.5, acceleration: 3.0, jerk: 200.0}}\n"
    "micro: {{velocity: 0.01, acceleration: 0.2, jerk: 20.0}}\n"
    "settle: {{window: 5.0e-8, hold: 0.005, timeout: 0.15}}\nexpose: 0\n"
    "sites: [{}]\nfiducial: {{source: none}}\n"
)
FILE = "calibrate: weekly\nsites: [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]\n"


@pytest.fixture(scope="module")
def machine():
    return load_machine()


@pytest.fixture
def sequence():
    """One by hand: to choose one, the estimator has to be compiled."""
    slide = Profile(0.5, 3.0, 200.0)
    moves = tuple(
        Excursion((offset, offset), "other", slide) for offset in (1.5e-3, 0.0, -1.5e-3, 0.0)
    )
    return SiteSequence(moves, 1.2, {})


def test_the_sequence_reaches_what_it_is_chosen_for(machine, tmp_path):
    path = tmp_path / "sites.yaml"
    path.write_text(FILE + "due: {days: 10, moves: 100, distance: 5.0}\n")
    calibration = load_calibration(path, machine)
    assert calibration.due == DUE
    assert calibration.recipe.excursions == calibration.sequence.excursions
    sequence = calibration.sequence
    assert sequence.reaches()
    assert sequence.duration < 2.0
    for gains in sequence.gains.values():
        for name, goal in GOALS.items():
            assert 0.0 < gains[name].after <= goal < gains[name].before
            assert gains[name].bits == pytest.approx(
                math.log2(gains[name].before / gains[name].after)
            )
    kinds = {e.kind for e in sequence.excursions}
    assert {"other", "micro", "creep"} <= kinds
    offsets = [e.offset[0] for e in sequence.excursions]
    assert min(offsets) < 0 < max(offsets)
    assert offsets[-1] == 0.0


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
def test_a_bad_file_is_told_with_its_place(machine, tmp_path, text, reason):
    path = tmp_path / "sites.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as refused:
        load_calibration(path, machine)
    assert reason in str(refused.value)
    assert "sites.yaml:" in str(refused.value)


@pytest.fixture
def history(tmp_path):
    opened = open_history(str(tmp_path / "stage.db"), write=True)
    yield opened
    opened.close()


def estimates(history, purpose, time, places, distance=0.01):
    number = history.start_run(
        RunEntry(STAGE, ("x", "y"), time, "r", None, None, "s", "f", purpose)
    )
    history.add(
        [
            EstimateRecord(
                number, "x", "other", 1, place, time, distance, True, None, {"coulomb": 6.0},
                (0.01,), 1.0, (6.0, 0.02),
            )
            for place in places
        ]
    )  # fmt: skip
    return number


def test_what_makes_a_site_due(history):
    limits, now = DUE, 1.7e9
    axes = ("x", "y")

    def due(at):
        return {
            d.place: d.reasons
            for d in due_sites(SITES, limits, history, STAGE, axes, at, None)
        }  # fmt: skip

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
    assert due(now + 900) == {SITES[2]: ("x: stepped by +20% since",)}
    history.add_step(StepRecord(run, "x", SITES[2], now + 850, 0.2, "common"))
    assert set(due(now + 900)) == set(SITES)


def test_due_sites_are_slipped_in_as_long_as_there_is_time(machine, sequence):
    recipe = parse_recipe(RECIPE.format("[0, 0], [0.03, 0], [0.03, 0.03]"), "r.yaml", machine)
    due = [DueSite((0.03, 0.028), ("old",), 3.0), DueSite((0.0, 0.001), ("old",), 2.0)]
    one = sequence.duration
    made, spent = slip_in(recipe, due, sequence, 1.6 * one)
    assert made.slipped == ((3, (0.03, 0.028)),)
    assert one < spent <= 1.6 * one
    both, spent = slip_in(recipe, due, sequence, 4 * one)
    assert dict(both.slipped) == {3: (0.03, 0.028), 1: (0.0, 0.001)}
    visited = [s.target for s in plan(both) if isinstance(s, MoveStep) and s.kind == "macro"]
    assert visited == [(0.0, 0.0), (0.0, 0.001), (0.03, 0.0), (0.03, 0.03), (0.03, 0.028)]
    none, spent = slip_in(recipe, due, sequence, 0.5 * one)
    assert (none, spent) == (recipe, 0.0)


def test_what_a_calibration_says_of_a_site():
    def entry(site, accepted, reason=None):
        figure = {"coulomb": {"value": 6.0, "sigma": 0.06, "unit": "N"}}
        return {
            "site": site, "axis": "x", "accepted": accepted, "reason": reason,
            "parameters": figure,
        }  # fmt: skip

    changes = [
        AxisChange(
            "x", 0.0, 0.1,
            (
                SiteChange(SITES[0], 0.2, 0.01), SiteChange(SITES[1], 0.05, 0.01),
                SiteChange(SITES[2], 0.05, 0.04),
            ),
        )
    ]  # fmt: skip
    friction = [entry(i, True) for i in (1, 2, 3)] + [entry(4, False, "residual 9 times")]
    found = outcomes([*SITES, SITES[0]], friction, ("x",), None, changes)
    assert [o.severity for o in found] == ["act", "watch", "good", "failed"]
    assert "dirt" in found[0].suggestion
    assert "residual 9 times" in found[3].suggestion
    assert found[0].gains["coulomb"].bits == pytest.approx(math.log2(0.3 / 0.01))
    figures = {
        name: {"value": 1.0, "sigma": sigma} for name, sigma in
        (("coulomb", 0.03), ("viscous", 0.05), ("stiffness", 0.01), ("attraction", 0.05))
    }  # fmt: skip
    told = outcomes(SITES[:1], [{**entry(1, True), "parameters": figures}], ("x",), None, [])
    # What is predicted is reached of: C/Fc instead of C, whose variance has that of Fc in it.
    assert set(told[0].gains) == set(START)
    assert told[0].gains["relaxation_rate"].after == pytest.approx(0.04)
    down = [replace(changes[0], sites=(SiteChange(SITES[0], -0.2, 0.01),))]
    assert "grease" in outcomes(SITES[:1], friction, ("x",), None, down)[0].suggestion


def test_sites_that_an_interrupted_calibration_did_not_come_to_have_no_outcome():
    friction = [{"site": 1, "accepted": True}, {"site": 2, "accepted": False}]
    assert visited(SITES, friction) == SITES[:2]
    assert visited(SITES, []) == ()


def test_the_calibration_that_comes_with_us_fits_the_packaged_machine(machine):
    path = Path(__file__).parents[4] / "recipes" / "calibration-9.yaml"
    assert len(load_calibration(path, machine).recipe.sites) == 9
