"""Changes between two maps."""

import pytest

from stagectl.maps import compare
from tests.unit.stagectl.maps.conftest import GRID


def test_a_spot_is_distinguished_from_a_change_of_the_whole_table(mapped):
    for axis in compare(mapped.first.map, mapped.second.map):
        assert axis.common == pytest.approx(0.08, abs=0.02)
        assert axis.sites[0].place == GRID[7]
        assert axis.sites[0].change == pytest.approx(0.2, abs=0.05)
        assert [s.place for s in axis.sites if s.significant] == [GRID[7]]
