"""Recursive filters against those of scipy."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sim2real.filters import filtered


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [([0.3], [1.0, -0.7]), ([0.2, 0.1], [2.0, -1.4]), ([1.0, -2.0, 1.0], [4.0, -3.0, 1.0])],
)
@pytest.mark.parametrize("shape", [(50,), (3, 50)])
def test_filters_are_those_of_scipy(numerator, denominator, shape):
    values = np.random.default_rng(1).standard_normal(shape)
    before = values.copy()
    found = filtered(numerator, denominator, values)
    np.testing.assert_allclose(found, lfilter(numerator, denominator, values), atol=1e-12)
    np.testing.assert_array_equal(values, before)
