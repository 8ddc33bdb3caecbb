"""Versions of a map, and the active one at the start of a run."""

import math

import numpy as np
import pytest

from stagectl.config.machine.file import load_machine
from stagectl.history import EstimateRecord, RunEntry
from stagectl.maps import load_active, map_versions
from stagectl.maps.active import REPLAYED
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, STAGE, calibrate, keep, level


def test_versions_activation_and_rollback(history):
    calibrate(history)
    first, _ = keep(history, BEGIN)
    second, _ = keep(history, BEGIN + 1)
    assert (first, second) == (1, 2)
    with pytest.raises(ValueError, match="no map 7"):
        history.activate(STAGE, 7, BEGIN, "activated")
    for number in (1, 2, None, 1):
        history.activate(STAGE, number, BEGIN, "activated")
        assert [v.number for v in map_versions(history, STAGE) if v.active] == [
            n for n in (number,) if n
        ]
    assert [a.number for a in history.activations(STAGE)] == [1, 2, None, 1]


def test_a_run_reads_no_more_of_a_longer_history(history):
    """Weeks of production say the same as their last visits, and take no longer."""
    calibrate(history)
    number, _ = keep(history, BEGIN)
    history.activate(STAGE, number, BEGIN, "activated")
    machine, place = load_machine(), GRID[7]
    generator = np.random.default_rng(4)
    run = history.start_run(RunEntry(STAGE, ("x", "y"), BEGIN + 500, "r", None, None, "s", "f"))
    rows = [
        EstimateRecord(
            run, "x", "macro", 1, place, BEGIN + 500 + 30 * k, 1e-3, True, None, {"coulomb": 6.0},
            (0.01,), 1.0, (1.03 * level("x", place) * (1 + 0.01 * generator.normal()), 0.02),
        )
        for k in range(5 * REPLAYED)
    ]  # fmt: skip
    history.add(rows[: 2 * REPLAYED])
    few = load_active(history, STAGE, machine, [place], rows[2 * REPLAYED - 1].time + 1.0).places
    history.add(rows[2 * REPLAYED :])
    many = load_active(history, STAGE, machine, [place], rows[-1].time + 1.0).places
    for places in (few, many):
        tracker, site = places.trackers["x"], places.number_of(place)
        assert tracker.moves[site] == REPLAYED
        mean, sigma = tracker.expected(site, wander=False)
        assert abs(mean - math.log(1.03 * level("x", place))) < 3.0 * sigma < 0.03
