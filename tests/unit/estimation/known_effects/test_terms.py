"""What a set of known terms says of itself."""

import pytest

from estimation.known_effects.terms import Base, KnownTerms


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


def test_two_axes_do_not_share_their_lists():
    one, other = KnownTerms(), KnownTerms()
    one.forces.append(lambda x: x)
    assert not other.has_forces
