"""Coulomb friction by direction, against the force of steady sliding."""

import pytest

from tests.unit.hil_sim.effects.closed_forms import FC, SPEED, VISCOUS, both_steps


@both_steps
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_coulomb_level_and_asymmetry_multiply(
    nominal, with_effects, effects, sliding, substeps, direction
):
    stage = with_effects(
        nominal,
        effects["coulomb_level"].at(ratio=1.25),
        effects["friction_asymmetry"].at(ratio=0.1),
    )
    _, _, force = sliding(stage, direction, substeps=substeps)
    expected = direction * (FC * 1.25 * (1.0 + 0.1 * direction) + VISCOUS * SPEED)
    assert force[-100:].mean() == pytest.approx(expected, abs=2e-3)
