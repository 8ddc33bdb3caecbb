"""A spot with more friction, against the force over position."""

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import FC, SPEED, VISCOUS, both_steps


@both_steps
def test_friction_position_is_a_bell(nominal, with_effects, effects, sliding, substeps):
    spot = effects["friction_position"].at(amplitude=0.5, center=0.03, width=6e-3)
    _, position, force = sliding(with_effects(nominal, spot), substeps=substeps)
    factor = 1.0 + 0.5 * np.exp(-0.5 * ((position - 0.03) / 6e-3) ** 2)
    # The elements follow a changing level at the rate C/Fc = 100/s: 10 ms, 1 mm late.
    late = 1.0 + 0.5 * np.exp(-0.5 * ((position - 1e-3 - 0.03) / 6e-3) ** 2)
    assert force.max() > FC * 1.45 + VISCOUS * SPEED
    np.testing.assert_allclose(force, FC * late + VISCOUS * SPEED, atol=0.06)
    assert np.abs(force - FC * factor - VISCOUS * SPEED).max() > 0.15
