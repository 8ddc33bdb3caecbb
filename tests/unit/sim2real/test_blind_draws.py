"""The blind check draws what docs/blind.md says, the same for the same seed, and seals it."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from hil_sim.effects.library import own_effects
from hil_sim.settings import StageSettings
from sim2real.blind import (
    OUTSIDE,
    VARIANTS,
    Key,
    digest_of,
    draw_demands,
    draw_key,
    draw_values,
    family,
    key_json,
    key_of,
    moves,
    seal,
    stage_of,
)
from sim2real.experiment import stroke
from stagectl.config.machine import load_machine
from stagectl.config.mapping import stage_settings

LIBRARY = own_effects()
TOLERANCE = {"x": 0.003, "y": 0.003}


@pytest.fixture(scope="module")
def stage() -> StageSettings:
    data = Path(str(resources.files("stagectl"))) / "data"
    return stage_settings(load_machine(data / "machines" / "wafer-xy.yaml"))


def drawn(stage: StageSettings, seed: int, kind: str | None = None) -> Key:
    rng = np.random.default_rng(seed)
    return draw_key(rng, stage, TOLERANCE, LIBRARY, lambda _: 3.0, kind=kind)


def test_a_stroke_ends_at_rest_where_it_should_and_keeps_its_limits() -> None:
    positions = stroke(-0.04, 0.3, 3.0, 200.0, 1e-3)
    padded = np.concatenate((np.zeros(3), positions, np.full(3, positions[-1])))
    velocity = np.diff(padded) / 1e-3
    acceleration = np.diff(velocity) / 1e-3
    jerk = np.diff(acceleration) / 1e-3
    assert positions[-1] == pytest.approx(-0.04, abs=1e-15)
    assert np.abs(velocity).max() == pytest.approx(0.3, rel=1e-6)
    assert np.abs(acceleration).max() == pytest.approx(3.0, rel=1e-6)
    assert np.abs(jerk).max() <= 200.0 * (1 + 1e-6)
    assert (velocity <= 1e-12).all()


def test_demands_stay_within_what_the_page_says(stage: StageSettings) -> None:
    for seed in range(8):
        demands = draw_demands(np.random.default_rng(seed), stage, 4.0)
        velocity = np.abs(np.diff(demands.position, axis=0)) / stage.sync_period
        acceleration = np.abs(np.diff(demands.position, 2, axis=0)) / stage.sync_period**2
        assert velocity.max() <= moves.MACRO_SPEED + 2e-6
        assert acceleration.max() <= moves.MACRO_ACCELERATION + 4e-3  # rounded to 1 nm
        assert np.abs(demands.position).max() <= moves.REACH[1] + moves.MICRO_REACH * 40
        rests = [b.start - a.end for a, b in zip(demands.moves, demands.moves[1:], strict=False)]
        assert min(rests) >= round(moves.REST[0] / stage.sync_period)
        assert max(rests) <= round(moves.REST[1] / stage.sync_period)
        for move in demands.moves:
            for a, axis in enumerate(stage.axes):
                assert demands.position[move.end - 1, a] == move.target[axis.name]
            if move.kind == "micro":
                assert max(abs(move.distance(n)) for n in ("x", "y")) <= moves.MICRO_REACH + 1e-9
        units = demands.offset / np.array([a.control.rated_force / 1000 for a in stage.axes])
        assert np.allclose(units, np.round(units), atol=1e-9)


def test_the_same_seed_draws_the_same_and_another_one_something_else(stage: StageSettings) -> None:
    keys = [drawn(stage, seed) for seed in range(30)]
    assert keys == [drawn(stage, seed) for seed in range(30)]
    assert len({str(key) for key in keys}) == len(keys)
    assert {key.kind for key in keys} == {"one", "two", "none", "outside", "departing"}


def test_sizes_are_within_the_plausible_ranges(stage: StageSettings) -> None:
    rng = np.random.default_rng(5)
    for effect in (*LIBRARY.values(), *VARIANTS, *OUTSIDE):
        for axis in stage.axes:
            values = draw_values(rng, effect, axis)
            for parameter in effect.parameters:
                inside = [
                    low <= values[parameter.key] <= high for low, high in parameter.ranges(axis)
                ]
                assert any(inside), (effect.name, parameter.key)


def test_two_effects_never_are_one_and_the_key_says_which_family(stage: StageSettings) -> None:
    for seed in range(20):
        first, second = drawn(stage, seed, "two").effects
        assert (first.axis, first.effect) != (second.axis, second.effect)
        assert {family(LIBRARY[e.effect]) for e in (first, second)} == {first.kin, second.kin}
    assert all(
        e.kin in LIBRARY for seed in range(5) for e in drawn(stage, seed, "departing").effects
    )
    assert all(not e.kin for seed in range(5) for e in drawn(stage, seed, "outside").effects)


def test_what_cannot_be_seen_is_drawn_again_and_given_up(stage: StageSettings) -> None:
    with pytest.raises(ValueError, match="opens no gap"):
        draw_key(
            np.random.default_rng(1), stage, TOLERANCE, LIBRARY, lambda _: 1.0, only="force_offset"
        )
    with pytest.raises(ValueError, match="no effect magic"):
        draw_key(np.random.default_rng(1), stage, TOLERANCE, LIBRARY, lambda _: 3.0, only="magic")


def test_the_stage_is_off_by_what_the_key_says(stage: StageSettings) -> None:
    key = drawn(stage, 3, "one")
    made = stage_of(stage, key, LIBRARY)
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


def test_the_seal_opens_with_its_key_and_no_other(stage: StageSettings) -> None:
    key = drawn(stage, 4)
    sealed = seal(key, np.random.default_rng(1))
    assert sealed.verifies()
    assert not replace(sealed, text=sealed.text.replace("0", "1", 1)).verifies()
    assert not replace(sealed, nonce="00" * 16).verifies()
    assert seal(key, np.random.default_rng(2)).digest != sealed.digest
    assert len(digest_of("", "")) == 64
    assert key_of(key_json(key)) == key
