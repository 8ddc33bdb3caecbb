"""What a set of known terms says of itself, and the friction figures with what is known of them."""

import pytest

from estimation.known_effects.terms import Base, KnownTerms, known_figures
from stagedata import FrictionFigures


def test_as_constructed_nothing_is_known():
    nothing = KnownTerms()
    assert not nothing.has_motor_factor
    assert not nothing.has_forces
    assert not nothing.has_coulomb_factor


@pytest.mark.parametrize(
    "terms", [{"gain": 0.9}, {"saturation": 80.0}, {"gains": [lambda x: 1.0 + 0.0 * x]}]
)
def test_the_force_on_the_carriage_may_differ_from_the_measured_one(terms):
    assert KnownTerms(**terms).has_motor_factor


@pytest.mark.parametrize(
    "terms",
    [
        {"forces": [lambda x: x]}, {"velocity_forces": [lambda v: v]}, {"hysteresis": [(1.0, 1e4)]},
        {"coupled_mass": 0.1}, {"bases": [Base(0.1, 10.0, 0.05)]},
    ],
)  # fmt: skip
def test_disturbance_forces(terms):
    assert KnownTerms(**terms).has_forces
    assert not KnownTerms(**terms).has_coulomb_factor


def test_both_directions_alike_are_no_factor_that_differs():
    assert not KnownTerms(forward=1.2, backward=1.2, coulomb=1.3).has_coulomb_factor
    assert KnownTerms(forward=1.2, backward=1.0).has_coulomb_factor
    assert KnownTerms(time_factors=[lambda t: t]).has_coulomb_factor


GMS = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
COULOMB = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, "coulomb")


def test_the_static_ratio_is_replaced_also_by_zero():
    assert known_figures(KnownTerms(static_ratio=0.0), GMS).static_ratio == 0.0


def test_what_the_law_does_not_have_stays_zero():
    found = known_figures(KnownTerms(coulomb=1.5, stiffness=2.0), COULOMB)
    assert (found.law, found.coulomb, found.stiffness) == ("coulomb", 9.0, 0.0)
