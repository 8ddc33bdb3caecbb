"""Drifts and common causes are found where they are, and chance is not taken for one."""

import numpy as np
import pytest

from stagectl.fleet.patterns import CHANCE, DAY, find_common, find_drifts
from stagectl.fleet.stages import COULOMB, Series, stage_states
from stagectl.history import StageKey


def series(value, per_day=1, name="A"):
    value = np.asarray(value, dtype=float)
    time = 1.7e9 + DAY * np.arange(len(value)) / per_day
    return Series(StageKey(name, False), "x", COULOMB, time, value)


def test_a_drift_has_the_slope_that_was_drawn():
    rng = np.random.default_rng(1)
    value = 6.0 + 0.02 * np.arange(60) / 3 + 0.05 * rng.standard_normal(60)
    value[7] = 40.0
    (drift,) = find_drifts([series(value, per_day=3)])
    assert drift.interval[0] < 0.02 < drift.interval[1]
    assert drift.per_day == pytest.approx(0.02, rel=0.15)
    assert (drift.days, drift.start) == (pytest.approx(19, abs=1), pytest.approx(6.0, abs=0.1))
    assert drift.change == pytest.approx(0.02 * drift.days / 6.0, rel=0.15)


def test_scatter_is_no_drift_in_a_fleet_of_many():
    rng = np.random.default_rng(2)
    fleets = [
        find_drifts([series(6.0 + rng.standard_normal(12), name=f"{n}") for n in range(60)])
        for _ in range(20)
    ]
    assert sum(map(bool, fleets)) <= 2  # 20 fleets at CHANCE each
    assert CHANCE == 0.01


def test_many_values_of_few_days_are_no_drift():
    assert find_drifts([series(np.arange(100), per_day=20), series([6.0] * 20)]) == []


def machine(**keys):
    return "\n".join(f"{key}: {value}" for key, value in keys.items())


def test_what_the_stages_with_an_effect_share_is_named_once(row):
    rows = []
    for number in range(30):
        supplier = "B" if number < 10 else "A"
        text = machine(name=number, supplier=supplier, part=f"{supplier}7", site=number % 2)
        effects = ["cogging"] if number < 9 else ["drag"] if number % 3 == 0 else []
        rows.append(row(f"S{number}", effects=effects, machine=text))
    (found,) = find_common(stage_states(rows))
    assert (found.effect, found.keys, found.values) == (
        "cogging",
        ("supplier", "part"),
        ("B", "B7"),
    )
    assert (found.of_those, found.of_others) == ((9, 9), (1, 21))
    assert found.chance < 1e-4


def test_few_stages_share_nothing(row):
    rows = [
        row(f"S{n}", effects=["cogging"] * (n < 3), machine=machine(supplier="AB"[n < 3]))
        for n in range(6)
    ]
    assert find_common(stage_states(rows)) == []
