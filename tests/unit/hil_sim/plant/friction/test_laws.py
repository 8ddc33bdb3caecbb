"""Friction at rest, whatever the law: it holds a force as far as its static limit."""

from typing import get_args

import numpy as np
import pytest

from hil_sim.plant.friction.gms import element_shares
from hil_sim.plant.friction.laws import NUMBERS, rest_forces
from stagedata import FrictionFigures, LawName

GMS = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
COULOMB = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, "coulomb")
both_laws = pytest.mark.parametrize("friction", [GMS, COULOMB], ids=["gms", "coulomb"])
STATIC = 8.4


def test_every_law_has_a_number_of_its_own():
    assert set(NUMBERS) == set(get_args(LawName))
    assert len(set(NUMBERS.values())) == len(NUMBERS)


@pytest.mark.parametrize("force", [0.0, 3.0, -3.0, 8.0])
@both_laws
def test_a_force_within_the_limit_is_held_exactly(friction, force):
    forces, held = rest_forces(friction, STATIC, force)
    assert held == pytest.approx(force, abs=1e-12)
    assert len(forces) == friction.elements
    if friction is GMS:
        assert forces.sum() == pytest.approx(force, abs=1e-12)


@pytest.mark.parametrize("way", [1.0, -1.0])
@both_laws
def test_more_is_held_up_to_the_limit(friction, way):
    _, held = rest_forces(friction, STATIC, way * 50.0)
    assert held == pytest.approx(way * STATIC)


def test_no_element_holds_more_than_its_share():
    for force in (7.0, 100.0):
        forces, _ = rest_forces(GMS, STATIC, force)
        assert (forces <= STATIC * element_shares(10) + 1e-12).all()
        assert np.ptp(forces / element_shares(10)) > 0.0 or force > STATIC
