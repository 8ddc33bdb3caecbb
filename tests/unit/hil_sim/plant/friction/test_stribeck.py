"""The Stribeck curve at its three characteristic points."""

import math

import pytest

from hil_sim.plant.friction.stribeck import stribeck

curve = stribeck.py_func


@pytest.mark.parametrize("shape", [0.5, 1.0, 2.0])
def test_it_falls_from_the_static_ratio_to_the_coulomb_level(shape):
    assert curve(0.0, 0.4, 2e-3, shape) == pytest.approx(1.4)
    # At vs a share 1/e of the rise is left, whatever the shape.
    assert curve(2e-3, 0.4, 2e-3, shape) == pytest.approx(1.0 + 0.4 / math.e)
    assert curve(2.0, 0.4, 2e-3, shape) == pytest.approx(1.0)


def test_the_shape_bends_it_and_the_direction_does_not_matter():
    assert curve(1e-3, 0.4, 2e-3, 2.0) == pytest.approx(1.0 + 0.4 * math.exp(-0.25))
    assert curve(-1e-3, 0.4, 2e-3, 2.0) == curve(1e-3, 0.4, 2e-3, 2.0)
