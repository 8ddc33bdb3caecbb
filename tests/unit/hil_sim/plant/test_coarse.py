"""One step per control tick, against the reference."""

import numpy as np

from hil_sim.plant import simulate
from tests.unit.hil_sim.inputs import smooth_demand


def test_one_step_per_tick_is_near_the_reference(nominal, with_effects, effects):
    demand = 3.0 * smooth_demand(3, 3000)
    stage = with_effects(
        nominal,
        effects["cogging"].at(amplitude=1.5, pitch=0.025, phase=1.0),
        effects["dead_time"].at(delay=0.00033),
        effects["resonance"].at(frequency=120.0, damping=0.02, mass_ratio=0.2),
        y=(
            effects["cross_coupling"].at(mass=0.5),
            effects["cable_hysteresis"].at(force=1.0, stiffness=3e3),
        ),
    )
    zero = np.zeros_like(demand)
    fine, coarse, plain = (
        simulate(s, demand, zero, None, substeps=n, rounded=False)
        for s, n in ((stage, 5), (stage, 1), (nominal, 5))
    )
    for signal, floor in (("position", 0.05e-6), ("force", 0.07)):
        a, b, c = (getattr(r, signal) for r in (fine, coarse, plain))
        difference = np.sqrt(np.mean((a - b) ** 2, axis=0))
        assert (difference < 0.2 * floor).all(), difference
        assert (np.sqrt(np.mean((a - c) ** 2, axis=0)) > 2 * floor).all()
