"""The factor on the Coulomb level, uncompiled; all that ports do: effects/test_equations.py."""

from types import SimpleNamespace

import pytest

from hil_sim.plant.ports.disturbances import (
    coulomb_factor,
)

FORWARD, BACKWARD = 1.2, 0.9


@pytest.mark.parametrize(("direction", "factor"), [(1.0, FORWARD), (-1.0, BACKWARD)])
def test_the_coulomb_factor_is_linear_about_its_place_and_depends_on_the_way(direction, factor):
    p = SimpleNamespace(coulomb_forward=FORWARD, coulomb_backward=BACKWARD, load_friction=0.0)
    s = SimpleNamespace(
        coulomb=1.5, coulomb_slope=100.0, position=0.011, place=0.010, transmitted=-5.0
    )
    assert coulomb_factor.py_func(p, s, direction) == pytest.approx(1.6 * factor)
    p.load_friction = 0.02
    assert coulomb_factor.py_func(p, s, direction) == pytest.approx(1.6 * factor + 0.1)
    s.position = -0.1  # a straight line would make friction drive the axis
    assert coulomb_factor.py_func(p, s, direction) == pytest.approx(0.1)
