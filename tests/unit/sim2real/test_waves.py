"""Sums over waves by one FFT, against the sums themselves."""

import numpy as np
import pytest

from sim2real.waves import wave_sums


@pytest.mark.parametrize("extent", [0.3, 3.0])
def test_sums_are_those_of_the_definition(extent):
    rng = np.random.default_rng(3)
    where = rng.uniform(-0.1, extent - 0.1, 4000)
    values = 1.0 + np.sin(2 * np.pi * 31 * where) + rng.normal(size=4000)
    lines = np.arange(5.0, 400.0)
    exact = np.exp(-2j * np.pi * lines[:, None] * (where - where.min())) @ values
    found = wave_sums(lines, where, values)
    slow = lines < 100.0
    size = np.abs(exact).max()
    assert np.abs(found - exact)[slow].max() < 0.06 * size
    assert int(np.abs(found).argmax()) == int(np.abs(exact).argmax())
    strong = np.abs(exact) > 0.5 * size
    assert np.abs(found[strong]) == pytest.approx(np.abs(exact[strong]), rel=0.02)
