"""A figure over the table as a picture."""

from __future__ import annotations

import re

import numpy as np
import pytest

from stagectl.maps.output.heat_map import HeatMap, draw_heat_map


@pytest.mark.parametrize(("long", "wide"), [(0.1, 0.1), (0.3, 0.1), (0.1, 0.2)])
def test_the_table_is_drawn_as_long_as_wide_as_it_is(long: float, wide: float) -> None:
    x, y = np.linspace(0.0, long, 20), np.linspace(0.0, wide, 20)
    corners = [(0.0, 0.0), (long, wide)]
    drawn = draw_heat_map(HeatMap(x, y, np.outer(x, y), corners, "force", "N"))
    places = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', drawn)
    (x0, y0), (x1, y1) = ((float(a), float(b)) for a, b in places)
    assert (x1 - x0) / (y0 - y1) == pytest.approx(long / wide, rel=0.02)
    assert 250.0 < max(x1 - x0, y0 - y1) < 300.0
