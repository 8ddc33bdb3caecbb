"""Friction that settles, against the force over time."""

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import FC, SPEED, VISCOUS, both_steps


@both_steps
def test_thermal_drift_fades(nominal, with_effects, effects, sliding, substeps):
    drift = effects["thermal_drift"].at(amplitude=0.4, time_constant=0.5)
    time, _, force = sliding(with_effects(nominal, drift), substeps=substeps)
    # First-order lag of 10 ms behind an exponential: it is late by tau/(1 - tau/time_constant).
    late = 0.4 / (1.0 - 0.01 / 0.5) * np.exp(-time / 0.5)
    np.testing.assert_allclose(force, FC * (1.0 + late) + VISCOUS * SPEED, atol=0.02)


@both_steps
def test_where_friction_and_warm_up_meet_they_multiply(
    nominal, with_effects, effects, sliding, substeps
):
    drift = effects["thermal_drift"].at(amplitude=0.3, time_constant=100.0)
    spot = effects["friction_position"].at(amplitude=0.4, center=0.05, width=20e-3)
    time, position, force = sliding(with_effects(nominal, drift, spot), substeps=substeps)
    bell = 1.0 + 0.4 * np.exp(-0.5 * ((position - 1e-3 - 0.05) / 20e-3) ** 2)
    expected = FC * bell * (1.0 + 0.3 * np.exp(-time / 100.0)) + VISCOUS * SPEED
    np.testing.assert_allclose(force, expected, atol=0.03)
