"""Coulomb level, against the force of steady sliding."""

from dataclasses import replace

import numpy as np

from hil_sim.plant import simulate


def test_coulomb_level_is_fc_and_c_together(nominal, with_effects, effects):
    rng = np.random.default_rng(5)
    demand = np.cumsum(rng.normal(0.0, 3e-6, (400, 2)), axis=0)
    x, y = nominal.axes
    scaled = replace(x.friction, coulomb=1.2 * 6.0)
    changed = replace(nominal, axes=(replace(x, friction=scaled), y))
    stage = with_effects(nominal, effects["coulomb_level"].at(ratio=1.2))
    zero = np.zeros_like(demand)
    one, other = simulate(stage, demand, zero, None), simulate(changed, demand, zero, None)
    np.testing.assert_allclose(one.position, other.position, atol=2e-9)
