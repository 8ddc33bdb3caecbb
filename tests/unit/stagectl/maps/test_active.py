"""Versions of a map, and the active one at the start of a run."""

import math

import numpy as np

from stagectl.config.machine.file import load_machine
from stagectl.maps import load_active
from stagectl.maps.active import REPLAYED
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, STAGE, activated, file, level


def test_a_run_reads_no_more_of_a_longer_history(history):
    """Weeks of production say the same as their last visits, and take no longer."""
    place, machine = GRID[7], load_machine()
    activated(history, [place])
    generator = np.random.default_rng(4)

    def moves(first, last):
        rows = [
            ("x", "macro", 1, place, BEGIN + 500 + 30 * k, {"coulomb": 6.0},
             (1.03 * level("x", place) * (1 + 0.01 * generator.normal()), 0.02))
            for k in range(first, last)
        ]  # fmt: skip
        file(history, BEGIN + 500, rows)
        return load_active(history, STAGE, machine, [place], rows[-1][4] + 1.0).places

    few, many = moves(0, 2 * REPLAYED), moves(2 * REPLAYED, 5 * REPLAYED)
    for places in (few, many):
        tracker, site = places.trackers["x"], places.number_of(place)
        assert tracker.moves[site] == REPLAYED
        mean, sigma = tracker.expected(site, wander=False)
        assert abs(mean - math.log(1.03 * level("x", place))) < 3.0 * sigma < 0.03
