"""A mass on the carriage, against its free-free mode."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.unit.hil_sim.effects.closed_forms import MASS, every_step, motor, travelled


@every_step
def test_resonance_is_the_free_free_mode(free, with_effects, effects, pushed, substeps, accuracy):
    # Constant force on two masses: the common mass accelerates, the mode rings and dies out.
    values = {"frequency": 110.0, "damping": 0.03, "mass_ratio": 0.25}
    stage = with_effects(free, effects["resonance"].at(**values))
    time, position, _ = pushed(stage, 40.0, substeps=substeps, duration=0.08)
    light, w, zeta = 0.75 * MASS, 2.0 * math.pi * 110.0, 0.03

    def rates(t, s):
        force = motor(t, 40.0)
        stretch = -force / light - 2.0 * zeta * w * s[3] - w**2 * s[2]
        return s[1], force / MASS - 0.25 * stretch, s[3], stretch

    solution = solve_ivp(
        rates, (0.0, time[-1]), (0.0,) * 4, t_eval=time, rtol=1e-10, atol=1e-14, max_step=1e-3
    )
    ringing = solution.y[0] - travelled(time, 40.0)
    assert np.ptp(ringing) > 5e-6
    assert np.abs(position - solution.y[0]).max() < max(0.02 * np.ptp(ringing), accuracy * 0.016)
    # Damped out, momentum is that of the whole mass.
    assert np.polyfit(time[-20:], position[-20:], 2)[0] * 2 == pytest.approx(5.0, rel=0.05)
