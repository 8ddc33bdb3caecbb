"""Friction figures with what is known of them."""

import pytest

from estimation.known_effects.figures import known_figures
from estimation.known_effects.terms import KnownTerms
from stagedata import FrictionFigures

GMS = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
COULOMB = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, "coulomb")


def test_ratios_multiply_and_the_relaxation_stays():
    found = known_figures(KnownTerms(coulomb=1.5, viscous=0.5, stiffness=2.0), GMS)
    assert (found.coulomb, found.viscous, found.stiffness) == (9.0, 10.0, 1.2e6)
    assert found.relaxation_rate == GMS.relaxation_rate
    assert found.attraction == pytest.approx(1.5 * GMS.attraction)
    assert found.static_ratio == GMS.static_ratio


def test_the_static_ratio_is_replaced_also_by_zero():
    assert known_figures(KnownTerms(static_ratio=0.0), GMS).static_ratio == 0.0


def test_what_the_law_does_not_have_stays_zero():
    found = known_figures(KnownTerms(coulomb=1.5, stiffness=2.0), COULOMB)
    assert (found.law, found.coulomb, found.stiffness) == ("coulomb", 9.0, 0.0)
