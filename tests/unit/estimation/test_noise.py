"""What the sensors add, against drawn noise."""

import numpy as np
import pytest

from estimation.noise import encoder_noise, quantisation


def test_quantisation_is_the_rms_of_rounding():
    values = np.random.default_rng(1).uniform(-5, 5, 100_000)
    assert np.std(values - np.round(values / 0.04) * 0.04) == pytest.approx(
        quantisation(0.04), rel=0.02
    )


def test_encoder_noise_with_its_increment():
    drawn = np.random.default_rng(2).normal(0.3e-9, 1e-9, 100_000)
    assert np.std(np.round(drawn / 1e-9) * 1e-9) == pytest.approx(
        encoder_noise(1e-9, 1e-9), rel=0.02
    )
    assert encoder_noise(2e-9, 0.0) == 2e-9
