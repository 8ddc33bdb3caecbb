"""Changes between two maps."""

import pytest

from stagectl.maps import compare
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, calibrate, keep


def test_a_spot_is_distinguished_from_a_change_of_the_whole_table(history):
    calibrate(history)
    _, before = keep(history, BEGIN)
    calibrate(history, BEGIN + 7 * 86400, GRID[7], 1.08, seed=2)
    _, after = keep(history, BEGIN + 7 * 86400)
    for axis in compare(before, after):
        assert axis.common == pytest.approx(0.08, abs=0.02)
        assert axis.sites[0].place == GRID[7]
        assert axis.sites[0].change == pytest.approx(0.2, abs=0.05)
        assert [s.place for s in axis.sites if s.significant] == [GRID[7]]
