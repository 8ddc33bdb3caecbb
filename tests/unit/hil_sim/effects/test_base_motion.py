"""A base that takes the reaction, against an independent integration."""

import math

import numpy as np
from scipy.integrate import solve_ivp

from tests.unit.hil_sim.effects.closed_forms import MASS, assert_close, every_step, motor, travelled


@every_step
def test_base_takes_the_reaction(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"frequency": 8.0, "damping": 0.06, "mass_ratio": 0.05}
    stage = with_effects(free, effects["base_motion"].at(**values))
    time, position, _ = pushed(stage, 20.0, substeps=substeps, duration=0.4)
    base, w = MASS / 0.05, 2.0 * math.pi * 8.0

    def rates(t, s):
        force = motor(t, 20.0)
        return s[1], force / MASS, s[3], -force / base - 2.0 * 0.06 * w * s[3] - w**2 * s[2]

    solution = solve_ivp(rates, (0.0, time[-1]), (0.0,) * 4, t_eval=time, rtol=1e-10, atol=1e-14)
    moved = np.ptp(solution.y[2])
    assert moved > 5e-5
    expected = solution.y[0] - solution.y[2]
    assert np.abs(position - expected).max() < max(0.01 * moved, accuracy * np.ptp(expected))


def test_without_isolators_momentum_is_conserved(free, with_effects, effects, pushed):
    # A base on next to no spring runs away backwards: m v + M V = impulse of nobody = 0.
    values = {"frequency": 1e-4, "damping": 0.0, "mass_ratio": 0.04}
    stage = with_effects(free, effects["base_motion"].at(**values))
    time, position, _ = pushed(stage, 20.0)
    assert_close(position, travelled(time, 20.0) * (1.0 + 0.04), 1e-4)
