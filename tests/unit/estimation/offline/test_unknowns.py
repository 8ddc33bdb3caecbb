"""Unknowns in scales and in units."""

import numpy as np
import pytest

from estimation.offline.unknowns import VISCOUS, unknowns
from stagedata import FrictionFigures

FRICTION = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)


@pytest.fixture
def u():
    return unknowns(FRICTION, 8.0, 1e-3)


def test_the_prior_is_the_machine_file(u):
    values = dict(zip(u.names, u.values(u.mean), strict=True))
    for name in ("coulomb", "viscous", "stiffness", "relaxation_rate", "static_ratio"):
        assert values[name] == getattr(FRICTION, name)
    assert values["mass"] == 8.0
    assert values["asymmetry"] == values["force_offset"] == values["lag"] == 0.0
    assert [values[f"k_{i}"] for i in range(1, 5)] == pytest.approx([0.25] * 4)
    assert [values[f"nu_{i}"] for i in range(1, 5)] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert (u.lower <= u.mean).all()
    assert (u.mean <= u.upper).all()


def test_springs_and_shares_add_to_one_whatever_the_factors(u):
    q = np.random.default_rng(1).uniform(0.1, 3.0, len(u.mean))
    springs, shares = u.shape(q)
    assert springs.sum() == pytest.approx(1.0)
    assert shares.sum() == pytest.approx(1.0)


def test_slopes_are_those_of_the_values(u):
    q = np.random.default_rng(2).uniform(0.5, 2.0, len(u.mean))
    step = 1e-6
    for j in range(len(q)):
        shift = np.zeros(len(q))
        shift[j] = step
        numeric = (u.values(q + shift) - u.values(q - shift)) / (2.0 * step)
        np.testing.assert_allclose(u.slopes(q)[:, j], numeric, rtol=1e-6, atol=1e-8)


def test_no_viscous_friction_still_has_a_scale():
    found = unknowns(FRICTION.with_figures({"viscous": 0.0}), 8.0, 1e-3)
    assert found.scale[VISCOUS] > 0.0
    assert found.values(found.mean)[VISCOUS] == 0.0
