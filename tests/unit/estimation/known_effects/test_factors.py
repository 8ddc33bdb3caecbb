"""The known factor on the Coulomb force: over place, time and direction."""

import numpy as np
import pytest

from estimation.known_effects.coulomb import TURN_BAND, coulomb_factor, directions
from estimation.known_effects.terms import KnownTerms

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
