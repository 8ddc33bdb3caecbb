"""An elasto-plastic element, against its loop."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate
from tests.unit.hil_sim.effects.closed_forms import both_steps


@both_steps
def test_cable_hysteresis_is_a_loop(nominal, with_effects, effects, substeps):
    # Slow sine by the closed loop without other friction: the motor's force is H, at each position.
    bare = replace(
        nominal,
        axes=tuple(
            replace(a, friction=replace(a.friction, coulomb=1e-9, viscous=0.0, stiffness=1e-6))
            for a in nominal.axes
        ),
    )
    stage = with_effects(bare, effects["cable_hysteresis"].at(force=1.5, stiffness=2000.0))
    time = 1e-3 * np.arange(4000)
    demand = np.column_stack([2e-3 * (1.0 - np.cos(2.0 * np.pi * 0.5 * time)), 0.0 * time])
    response = simulate(stage, demand, 0.0 * demand, None, substeps=substeps, rounded=False)
    position, force = response.position[:, 0], response.force[:, 0]
    expected, held = np.zeros(len(time)), 0.0
    for k in range(1, len(time)):
        held = min(max(held + 2000.0 * (position[k] - position[k - 1]), -1.5), 1.5)
        expected[k] = held
    acceleration = 2e-3 * np.pi**2 * np.cos(np.pi * time)
    begun = slice(100, None)
    np.testing.assert_allclose(force[begun], (expected + 8.0 * acceleration)[begun], atol=0.03)
    # Work lost in the second cycle: 4 f (amplitude - f/k).
    cycle = slice(2000, 4000)
    lost = np.trapezoid(force[cycle], position[cycle])
    assert lost == pytest.approx(4.0 * 1.5 * (2e-3 - 1.5 / 2000.0), rel=0.01)
