"""Effects outside the library: simulated, strong enough to be seen, and in no list."""

import math
from dataclasses import replace

import numpy as np

from hil_sim.effects.library import own_effects
from hil_sim.plant.simulate import simulate_variants
from sim2real.blind.unlisted_effects import UNLISTED, UNLISTED_VARIANTS


def middle(axis, effect):
    """Middle of each range; places where the recordings are."""
    values = {}
    for p in effect.parameters:
        low, high = p.ranges(axis)[-1]
        values[p.key] = 0.0 if p.role == "place" else (low + high) / 2.0
    return values


def test_they_are_outside_the_library_and_their_families_inside():
    known = own_effects()
    names = [e.name for e in (*UNLISTED, *UNLISTED_VARIANTS)]
    assert len(set(names)) == len(names)
    assert not set(names) & set(known)
    assert all(e.family in known for e in UNLISTED_VARIANTS)
    assert all(not e.family and not e.searched for e in UNLISTED)


def test_each_shows_in_a_recording(stage, recorded):
    axis, x = stage.axes[0], recorded.axes["x"]
    every = (*UNLISTED, *UNLISTED_VARIANTS)
    changed = (replace(axis, effects=(e.at(**middle(axis, e)),)) for e in every)
    response = simulate_variants(
        replace(stage, axes=(axis, *changed)), x.position_demand, x.force_offset
    )
    assert np.isfinite(response.position).all()
    nominal = response.position[:, 0], response.force[:, 0]
    for i, effect in enumerate(every, 1):
        floors = (0.05e-6, 0.07)  # what a perfect model still shows
        gap = math.sqrt(
            sum(
                np.mean((signal[:, i] - plain) ** 2) / floor**2
                for signal, plain, floor in zip(
                    (response.position, response.force), nominal, floors, strict=True
                )
            )
        )
        assert gap > 2.0 * math.sqrt(2.0), (effect.name, gap)


def test_none_of_its_size_is_no_effect(stage, recorded):
    axis, x = stage.axes[0], recorded.axes["x"]
    demand, offset = x.position_demand[:1500], x.force_offset[:1500]
    for effect in (*UNLISTED, *UNLISTED_VARIANTS):
        (size,) = (p for p in effect.parameters if p.role == "size")
        values = middle(axis, effect) | {size.key: size.neutral_on(axis)}
        nothing = replace(axis, effects=(effect.at(**values),))
        response = simulate_variants(replace(stage, axes=(axis, nothing)), demand, offset)
        off = np.abs(response.position[:, 0] - response.position[:, 1])
        assert off.max() <= 2.1e-9, effect.name
