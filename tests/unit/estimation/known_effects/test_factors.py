"""The known factors: on the Coulomb force over place, time and direction; on the motor's force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.known_effects import KnownTerms, delivered_force, force_to_demand, inverses
from estimation.known_effects.factors import TURN_BAND, coulomb_factor, directions

PLACE = st.floats(-0.15, 0.15)
X = np.linspace(0.0, 0.1, 11)
ZERO = np.zeros(11)


def test_factors_over_table_and_time_multiply():
    terms = KnownTerms(
        table_factors=[lambda x, y: 1.0 + x + 10.0 * y, lambda x, y: 2.0 + 0.0 * x],
        time_factors=[lambda t: 1.0 - 0.1 * t],
    )
    factor = coulomb_factor(terms, X, ZERO + 0.01, ZERO + 3.0)
    np.testing.assert_allclose(factor, (1.0 + X + 0.1) * 2.0 * 0.7)


@pytest.mark.parametrize(("heading", "factor"), [(1.0, 1.2), (-1.0, 0.8), (0.0, 1.0), (None, 1.0)])
def test_directions_differ_and_their_mean_counts_where_there_is_none(heading, factor):
    terms = KnownTerms(forward=1.2, backward=0.8)
    along = None if heading is None else np.full(11, heading)
    np.testing.assert_allclose(coulomb_factor(terms, X, ZERO, ZERO, along), factor)


def test_friction_never_vanishes():
    terms = KnownTerms(table_factors=[lambda x, y: 0.5 - 10.0 * x])
    assert (coulomb_factor(terms, X, ZERO, ZERO) > 0.0).all()


def test_the_direction_turns_once_the_way_back_exceeds_the_noise():
    noise = 0.9 * TURN_BAND
    position = np.cumsum([0.0, 1e-6, 1e-6, -noise, noise, -1e-6, -1e-6, noise, 1e-6])
    assert directions(position).tolist() == [0, 1, 1, 1, 1, -1, -1, -1, 1]


def test_a_slow_start_has_a_direction_as_soon_as_it_is_beyond_the_noise():
    position = np.arange(6) * 0.4 * TURN_BAND
    assert directions(position).tolist() == [0, 0, 0, 1, 1, 1]


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
