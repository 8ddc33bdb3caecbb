"""Setpoints that shake an axis: from rest to rest, within all limits, with power over the band."""

import numpy as np
import pytest

from stagectl.recipe import Excite, Profile
from stagectl.sequencer.excitation import excitation_setpoints

PERIOD = 1e-3
PROFILE = Profile(0.02, 1.0, 200.0)


@pytest.mark.parametrize("shape", ["chirp", "multisine"])
@pytest.mark.parametrize("profile", [PROFILE, Profile(1e-3, 0.05, 4.0)])
def test_limits_and_rest_at_both_ends(shape, profile):
    wanted = Excite(0, shape, 50e-6, (2.0, 120.0), 5.0, profile)
    x = excitation_setpoints(wanted, PERIOD)
    assert len(x) == 5000
    assert x[-1] == 0.0
    path = np.concatenate((np.zeros(3), x, np.zeros(3)))
    limits = (wanted.amplitude, profile.velocity, profile.acceleration, profile.jerk)
    used = [np.abs(np.diff(path, n)).max() / PERIOD**n / limit for n, limit in enumerate(limits)]
    assert max(used) <= 1.0 + 1e-9
    assert max(used) > 0.5, "the limits are used"


@pytest.mark.parametrize("shape", ["chirp", "multisine"])
def test_acceleration_over_the_whole_band(shape):
    """Every octave of the band has power, hardly any lies outside."""
    x = excitation_setpoints(Excite(0, shape, 50e-6, (4.0, 128.0), 8.0, PROFILE), PERIOD)
    frequency = np.fft.rfftfreq(len(x) - 2, PERIOD)
    power = np.abs(np.fft.rfft(np.diff(x, 2))) ** 2

    def share(low, high):
        return power[(frequency >= low) & (frequency < high)].sum() / power.sum()

    for low in (4.0, 8.0, 16.0, 32.0, 64.0):
        assert share(low, 2.0 * low) > 0.003
    assert share(3.0, 150.0) > 0.99
