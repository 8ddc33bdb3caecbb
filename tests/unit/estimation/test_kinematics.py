"""Velocity, acceleration and the noise they carry."""

import numpy as np
import pytest

from estimation.kinematics import differentiate, force_noise


def test_exact_for_constant_acceleration():
    t = np.arange(50) * 1e-3
    motion = differentiate(0.1 + 0.2 * t + 1.5 * t**2, 1e-3)
    np.testing.assert_allclose(motion.velocity, 0.2 + 3.0 * t[1:-1], rtol=1e-9)
    np.testing.assert_allclose(motion.acceleration, 3.0, rtol=1e-6)
    assert len(motion.position) == 48


def test_noise_is_what_it_says():
    rng = np.random.default_rng(2)
    x = np.round(rng.normal(0.0, 1e-9, 20000) / 1e-9) * 1e-9
    force = np.round(rng.uniform(-1, 1, 20000) / 0.04) * 0.04 - rng.uniform(-0.02, 0.02, 20000)
    seen = np.std(8.0 * differentiate(x, 1e-3).acceleration)
    quantised = 0.04 / np.sqrt(12)
    assert force_noise(8.0, 1e-9, 1e-9, 0.0, 1e-3) == pytest.approx(seen, rel=0.05)
    assert force_noise(0.0, 1e-9, 1e-9, 0.04, 1e-3) == pytest.approx(quantised)
    assert np.std(force - np.round(force / 0.04) * 0.04) == pytest.approx(quantised, rel=0.05)


def test_too_short():
    with pytest.raises(ValueError, match="3 samples"):
        differentiate(np.zeros(2), 1e-3)
