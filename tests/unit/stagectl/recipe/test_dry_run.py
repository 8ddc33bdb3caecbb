"""Counts, path, duration and use of the limits against figures worked out by hand."""

import json

import pytest

from stagectl.recipe import dry_run
from tests.unit.stagectl.printed import printed

HEAD = """recipe: a
macro: {velocity: 0.1, acceleration: 1.0, jerk: 100.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 50 nm, hold: 5 ms, timeout: 0.15}
"""


def test_a_long_move_takes_distance_over_velocity_plus_ramps(machine, recipe_of):
    recipe = recipe_of(HEAD + "expose: 20 ms\nfiducial: {source: none}\nsites: [[0.03, 0.1]]\n")
    outcome = dry_run(recipe, machine)
    # jerk-limited, rest to rest, v and a reached: d/v + v/a + a/j
    assert outcome.duration == pytest.approx(0.1 / 0.1 + 0.1 / 1 + 1 / 100 + 0.005 + 0.02, abs=1e-6)
    assert outcome.path_length == pytest.approx((0.03**2 + 0.1**2) ** 0.5)
    assert (outcome.sites, outcome.moves) == (1, {"macro": 1})


def test_a_short_move_reaches_neither_limit(machine, recipe_of):
    recipe = recipe_of(HEAD + "moves: [{reverse: 1 um, axis: x}, {dwell: 0.5}]\n")
    outcome = dry_run(recipe, machine)
    # four phases of equal jerk: d = 2 j t^3
    assert outcome.duration == pytest.approx(4 * (1e-6 / 2 / 20) ** (1 / 3) + 0.5, abs=1e-6)
    assert outcome.positions == ((1e-6, 0.0),)
    used = {(use.axis, use.quantity): use.used for use in outcome.limits}
    assert used["x", "velocity"] == 0.01
    assert used["y", "velocity"] == 0.0
    assert used["x", "highest"] == 1e-6


def test_the_shipped_recipe_as_json_and_in_a_terminal(inspection, machine, recipe_of):
    outcome = dry_run(recipe_of(inspection), machine)
    assert outcome.moves == {"macro": 20, "micro": 20}
    assert 3.0 < outcome.duration < 10.0
    assert all(abs(use.used) <= abs(use.limit) for use in outcome.limits)
    assert len(outcome.positions) == 40
    data = json.loads(json.dumps(outcome.as_dict(), allow_nan=False))
    assert data["sites"] == 20
    assert data["limits"][0] == {
        "axis": "x", "quantity": "velocity", "used": 0.5, "limit": 1.0, "unit": "m/s",
    }  # fmt: skip
    shown = printed(outcome.render(), 80)
    assert "20 macro, 20 micro" in shown
    assert "nothing moves" in shown


def test_sites_without_a_listed_mark_have_no_micro_move(machine, recipe_of, tmp_path):
    (tmp_path / "o.csv").write_text("site,dx,dy\n2,1e-6,0\n")
    recipe = recipe_of(
        HEAD + f"expose: 0\nsites: [[0, 0.01], [0, 0.02]]\n"
        f"fiducial: {{source: offsets, file: {tmp_path}/o.csv}}\n"
    )
    outcome = dry_run(recipe, machine)
    assert outcome.moves == {"macro": 2, "micro": 1}
    assert outcome.notes == ("site 1: no mark listed, no micro-move",)
