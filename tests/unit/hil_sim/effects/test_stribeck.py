"""Static ratio, against the nominal plant with that figure."""

from dataclasses import replace

import numpy as np

from hil_sim.plant import simulate


def test_stribeck_replaces_the_static_ratio(nominal, with_effects, effects):
    rng = np.random.default_rng(2)
    demand = np.cumsum(rng.normal(0.0, 3e-6, (400, 2)), axis=0)
    x, y = nominal.axes
    changed = replace(nominal, axes=(replace(x, friction=replace(x.friction, static_ratio=1.1)), y))
    stage = with_effects(nominal, effects["stribeck"].at(static_ratio=1.1))
    zero = np.zeros_like(demand)
    one, other = simulate(stage, demand, zero, 3), simulate(changed, demand, zero, 3)
    assert one.position.tobytes() == other.position.tobytes()
    plain = simulate(nominal, demand, zero, 3)
    assert np.abs(plain.position - one.position)[:, 0].max() > 1e-8
    assert plain.position[:, 1].tobytes() == one.position[:, 1].tobytes()
