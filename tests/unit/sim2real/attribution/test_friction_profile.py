"""Stop operators, of which any hysteresis over travel is a sum."""

import numpy as np

from sim2real.attribution.friction_profile import stop_operators


def test_a_stop_follows_its_travel_and_slides_at_one():
    position = np.array([0.0, 0.5, 1.5, 3.0, 2.5, 0.0, -2.0])
    expected = [0.0, 0.5, 1.0, 1.0, 0.5, -1.0, -1.0]
    np.testing.assert_allclose(stop_operators(position, np.array([1.0]))[:, 0], expected)


def test_narrower_stops_slide_earlier():
    position = np.linspace(0.0, 1.0, 11)
    narrow, wide = stop_operators(position, np.array([0.2, 2.0])).T
    assert (narrow[2:] == 1.0).all()
    np.testing.assert_allclose(wide, position / 2.0, atol=1e-12)
