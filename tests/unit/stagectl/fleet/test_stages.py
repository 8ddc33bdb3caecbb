"""What a stage is like now is what most of its last recordings say."""

import numpy as np
import pytest

from stagectl.fleet.rows import REFUSED
from stagectl.fleet.stages import COULOMB, GAP, series_of, stage_states
from stagectl.history import StageKey


def test_stages_are_ranked_by_the_median_gap_of_their_last_five_recordings(row):
    rows = [row("A", day, floors=gap) for day, gap in enumerate((90, 90, 1, 2, 3, 4, 99))]
    rows += [row("B", day, floors=gap) for day, gap in enumerate((5, 5))]
    rows += [row("C", verdict="insufficient", floors=None), row("B", 9, verdict=REFUSED)]
    first, second, third = stage_states(reversed(rows))
    assert [(s.key.machine, s.floors) for s in (first, second, third)] == [
        ("B", 5), ("A", 3), ("C", None)
    ]  # fmt: skip
    assert (second.recordings, second.latest, second.last) == (7, 5, rows[6]["started"])
    assert third.verdict == "insufficient"


def test_an_effect_counts_that_more_than_half_of_them_name(row):
    unsure = [row("A", 3)["causes"] or [], row("A", 3, ["drag"])["causes"]][1]
    rows = [row("A", day, ["cogging", "drag"] if day == 0 else ["cogging"]) for day in range(3)]
    rows.append(row("A", 3, causes=[{**unsure[0], "probability": 0.4}]))
    (state,) = stage_states(rows)
    (found,) = state.effects
    assert (found.effect, found.axis, found.recordings, found.remedy) == ("cogging", "x", 3, "mend")
    assert found.gap_closed == 0.8


def test_attributes_are_the_leaves_of_the_machine_file_with_recipe_and_lot(row):
    machine = "machine: {name: A}\naxes: {x: {eds: a.eds, range: [1, 2]}}"
    (state,) = stage_states([row("A", machine=machine, recipe="r", lot=None)])
    assert state.attributes == {
        "machine.name": "A", "axes.x.eds": "a.eds", "axes.x.range": "1, 2", "recipe": "r"
    }  # fmt: skip


def test_simulated_and_real_stages_of_one_name_are_two(row):
    assert len(stage_states([row("A"), row("A", simulated=True)])) == 2


def test_friction_that_a_history_has_too_counts_once(row):
    rows = [row("A", day, coulomb=6.0 + day) for day in (0, 2)]
    rows.append(row("A", 3, started=None))
    extra = [
        {"stage": "A", "simulated": False, "axis": "x", "started": r["started"], "coulomb": 6.0}
        for r in (rows[0], row("A", 1))
    ]
    found = {(of.axis, of.figure): of for of in series_of(rows, extra)}
    assert found["x", COULOMB].value.tolist() == [6.0, 6.0, 8.0]
    assert np.diff(found["x", COULOMB].time) == pytest.approx(86_400)
    assert len(found["", GAP].time) == 2
    assert found["", GAP].key == StageKey("A", False)
