"""Jerk-limited strokes."""

from __future__ import annotations

import numpy as np
import pytest

from sim2real.experiment import stroke


def test_a_stroke_ends_at_rest_where_it_should_and_keeps_its_limits():
    positions = stroke(-0.04, 0.3, 3.0, 200.0, 1e-3)
    padded = np.concatenate((np.zeros(3), positions, np.full(3, positions[-1])))
    velocity = np.diff(padded) / 1e-3
    acceleration = np.diff(velocity) / 1e-3
    jerk = np.diff(acceleration) / 1e-3
    assert positions[-1] == pytest.approx(-0.04, abs=1e-15)
    assert np.abs(velocity).max() == pytest.approx(0.3, rel=1e-6)
    assert np.abs(acceleration).max() == pytest.approx(3.0, rel=1e-6)
    assert np.abs(jerk).max() <= 200.0 * (1 + 1e-6)
    assert (velocity <= 1e-12).all()
