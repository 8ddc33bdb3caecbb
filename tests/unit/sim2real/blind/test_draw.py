"""The blind check draws what docs/blind.md says, the same for the same seed, and seals it."""

from __future__ import annotations

import numpy as np
import pytest

from sim2real.blind.draw import build_stage, draw_key, draw_values, family_of
from sim2real.blind.reserved_effects import OUTSIDE, VARIANTS
from tests.unit.sim2real.blind.conftest import LIBRARY, TOLERANCE, drawn


def test_the_same_seed_draws_the_same_and_another_one_something_else(stage):
    keys = [drawn(stage, seed) for seed in range(30)]
    assert keys == [drawn(stage, seed) for seed in range(30)]
    assert len({str(key) for key in keys}) == len(keys)
    assert {key.kind for key in keys} == {"one", "two", "none", "outside", "departing"}


def test_sizes_are_within_the_plausible_ranges(stage):
    rng = np.random.default_rng(5)
    for effect in (*LIBRARY.values(), *VARIANTS, *OUTSIDE):
        if effect.name.endswith("_table"):
            continue  # tables are not drawn
        for axis in stage.axes:
            values = draw_values(rng, effect, axis)
            for parameter in effect.parameters:
                inside = [
                    low <= values[parameter.key] <= high for low, high in parameter.ranges(axis)
                ]
                assert any(inside), (effect.name, parameter.key)


def test_two_effects_never_are_one_and_the_key_says_which_family(stage):
    for seed in range(20):
        first, second = drawn(stage, seed, "two").effects
        assert (first.axis, first.effect) != (second.axis, second.effect)
        assert {family_of(LIBRARY[e.effect]) for e in (first, second)} == {first.kin, second.kin}
    assert all(
        e.kin in LIBRARY for seed in range(5) for e in drawn(stage, seed, "departing").effects
    )
    assert all(not e.kin for seed in range(5) for e in drawn(stage, seed, "outside").effects)


def test_several_effects_are_different_ones_of_one_axis(stage):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        key = draw_key(rng, stage, TOLERANCE, LIBRARY, lambda _: 3.0, several=4)
        assert key.kind == "several"
        assert len({drawn.effect for drawn in key.effects}) == 4
        assert len({drawn.axis for drawn in key.effects}) == 1


def test_effects_that_open_no_gap_are_drawn_again_then_refused(stage):
    with pytest.raises(ValueError, match="opens no gap"):
        draw_key(
            np.random.default_rng(1), stage, TOLERANCE, LIBRARY, lambda _: 1.0, only="force_offset"
        )
    with pytest.raises(ValueError, match="no effect magic"):
        draw_key(np.random.default_rng(1), stage, TOLERANCE, LIBRARY, lambda _: 3.0, only="magic")


def test_the_stage_is_off_by_what_the_key_says(stage):
    key = drawn(stage, 3, "one")
    made = build_stage(stage, key, LIBRARY)
    for nominal, axis in zip(stage.axes, made.axes, strict=True):
        off = key.base[axis.name]
        assert axis.mass == pytest.approx(nominal.mass * (1 + off["mass"]))
        assert axis.friction.stiffness == pytest.approx(
            nominal.friction.stiffness * (1 + off["stiffness"])
        )
        assert 0 < abs(off["stribeck_velocity"]) < 6 * TOLERANCE[axis.name]
        there = [(axis.name, e.effect.name, e.parameters) for e in axis.effects]
        assert there == [
            (d.axis, d.effect, dict(d.values)) for d in key.effects if d.axis == axis.name
        ]
