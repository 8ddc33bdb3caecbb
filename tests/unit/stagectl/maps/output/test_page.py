"""Pictures and lists of a map's page."""

import re

import numpy as np
import pytest

from stagectl.maps import draw_maps
from stagectl.maps.output.surface import surface
from tests.unit.stagectl.maps.conftest import two_versions


@pytest.fixture
def versions(history):
    return two_versions(history, everywhere=1.3)


def scale(picture):
    """Lowest and highest number beside the colour scale."""
    numbers = re.findall(r'text-anchor="start">([\d.]+)</text>', picture)
    return float(numbers[0]), float(numbers[2])


def test_maps_that_are_compared_have_one_scale(versions):
    first, second = versions
    drawn = draw_maps(second, first)
    for name, axis in second.map.axes.items():
        now, before, _ = drawn[name]
        assert scale(now) == scale(before)
        values = [surface(a).value for a in (axis, first.map.axes[name])]
        low, high = scale(now)
        assert low == pytest.approx(min(map(np.nanmin, values)), abs=0.006)
        assert high == pytest.approx(max(map(np.nanmax, values)), abs=0.006)
    x, y = (scale(drawn[name][-1]) for name in ("x", "y"))
    assert x == y
    alone = draw_maps(second, None)
    assert all(len(pictures) == 2 for pictures in alone.values())
