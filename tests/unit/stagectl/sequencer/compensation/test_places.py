"""Without a map: at a new place the Coulomb force is open again, at the same one it is not."""

from types import SimpleNamespace

import numpy as np
import pytest

from stagectl.sequencer.compensation.places import SAME_PLACE, SPREAD, FreshPlaces


@pytest.fixture
def places():
    return FreshPlaces({"x": 6.0, "y": 9.0})


def estimate(coulomb, level=1.0):
    return SimpleNamespace(friction=SimpleNamespace(coulomb=coulomb), level=level)


def test_a_new_place_is_like_the_last_one_with_a_wide_spread(places):
    first = places.expected_at((0.0, 0.0), 0.0)
    assert [(e.coulomb, e.sigma, e.level) for e in first] == [
        (6.0, SPREAD * 6.0, None), (9.0, SPREAD * 9.0, None),
    ]  # fmt: skip
    assert places.learn(0, "micro", estimate(7.0, level=1.1), 1.0) is None
    second = places.expected_at((0.02, 0.0), 2.0)
    assert [e.coulomb for e in second] == pytest.approx([7.7, 9.0])


def test_moves_around_a_place_stay_there(places):
    places.expected_at((0.0, 0.0), 0.0)
    assert places.expected_at((0.8 * SAME_PLACE, 0.0), 0.1) is None
    # measured from where the place began, so that small moves cannot creep away unnoticed
    assert places.expected_at((1.6 * SAME_PLACE, 0.0), 0.2) is not None


def test_nothing_is_known_along_a_path_and_long_moves_teach_nothing(places):
    np.testing.assert_array_equal(places.coulomb_variation(0, np.zeros((4, 2))), np.zeros(4))
    assert not places.knows_path("macro")
    assert all(places.knows_path(kind) for kind in ("micro", "creep", "other"))
