"""The resolution of a log."""

import numpy as np
import pytest

from sim2real.gap import quantisation_step

RNG = np.random.default_rng(1)


@pytest.mark.parametrize("step", [1e-9, 0.04, 1e-5])
def test_values_on_a_grid_have_its_step(step):
    values = np.rint(RNG.normal(0.0, 40.0, 500)) * step + 3.2 * step
    assert quantisation_step(values) == pytest.approx(step, rel=1e-6)


def test_real_numbers_have_none():
    assert quantisation_step(RNG.normal(size=500)) is None
    assert quantisation_step(np.array([1.0, 2.0])) is None
