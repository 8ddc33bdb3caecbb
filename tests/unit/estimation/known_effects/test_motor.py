"""Between measured force and force on the carriage, and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.known_effects import KnownTerms, delivered_force, force_to_demand, inverses

PLACE = st.floats(-0.15, 0.15)


def known():
    terms = KnownTerms()
    inverses.force_constant(terms, {"ratio": 0.93})
    inverses.force_saturation(terms, {"force": 50.0})
    inverses.force_ripple(terms, {"ratio": 0.06, "pitch": 0.011, "phase": 1.0})
    return terms


@given(st.floats(-100.0, 100.0), PLACE)
def test_there_and_back(measured, place):
    force = delivered_force(known(), np.array([measured]), np.array([place]))
    back = force_to_demand(known(), force, np.array([place]))
    assert back[0] == pytest.approx(measured, abs=1e-6)


@given(st.floats(-1e4, 1e4), PLACE)
def test_a_force_beyond_the_saturation_has_a_finite_demand(force, place):
    demand = force_to_demand(known(), np.array([force]), np.array([place]))
    assert abs(demand[0]) < 4 * 50.0
    assert demand[0] * force >= 0.0


def test_nothing_known_changes_nothing():
    force = np.array([-3.0, 0.0, 7.0])
    assert not KnownTerms().has_motor_factor
    np.testing.assert_array_equal(delivered_force(KnownTerms(), force, force), force)
    np.testing.assert_array_equal(force_to_demand(KnownTerms(), force, force), force)
