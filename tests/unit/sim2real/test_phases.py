"""Moves and phases cut out of a demand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sim2real import phases
from sim2real.phases import (
    PHASES,
    group_repeated_moves,
    kinds_of_moves,
    split_moves,
    split_phases,
)
from stagectl.store import read_recording
from stagedata import AxisSignals, Recording
from tests.unit.sim2real.conftest import DATA

PERIOD = 1e-3


def ramp(length, acceleration=2.0, cruise=100, rest=300):
    """A trapezoidal move from 0 with rests before and after; velocity reaches 0.1 m/s."""
    up = np.arange(1, 51) * acceleration * PERIOD
    speed = np.concatenate((np.zeros(rest), up, np.full(cruise, up[-1]), up[::-1], np.zeros(rest)))
    moved = np.cumsum(speed)
    return moved / moved[-1] * length


def swept(places):
    """Trapezoidal moves from place to place [m]."""
    return np.concatenate([start + ramp(end - start) for start, end in pairwise(places)])


def recording(demand, moves=()):
    signals = AxisSignals(
        demand, np.zeros_like(demand), demand, np.zeros_like(demand), None,
        np.ones(len(demand), dtype=bool),
    )  # fmt: skip
    return Recording("", "", "", np.arange(len(demand)) * PERIOD, {"x": signals}, moves, "here")


def named(demand):
    found = split_phases(demand, PERIOD)
    return [PHASES[i] for i in found.phase], found


def test_a_long_move_goes_through_its_phases_in_order():
    names, found = named(ramp(15e-3))
    order = [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
    assert order == ["rest", "onset", "acceleration", "cruise", "deceleration", "settling", "rest"]
    assert names.count("settling") == 100
    assert names.count("cruise") == pytest.approx(100, abs=8)
    (stroke,) = found.strokes
    assert (stroke.direction, stroke.length) == (1, pytest.approx(15e-3))
    assert found.velocity[400] == pytest.approx(0.1, rel=0.01)


def test_direction_stays_that_of_the_last_motion_at_rest():
    _, found = named(-ramp(15e-3))
    assert found.direction[0] == 0
    assert found.direction[-1] == -1


def test_a_short_move_is_micro_throughout():
    names, _ = named(ramp(60e-6))
    assert {"rest", "micro", "settling"} == set(names)
    assert names.count("micro") == pytest.approx(200, abs=2)


def test_a_turn_starts_a_new_onset():
    there = ramp(15e-3, rest=100)
    names, found = named(np.concatenate((there[:300], there[:300][::-1])))
    assert [s.direction for s in found.strokes] == [1, -1]
    turn = found.strokes[1].start
    assert names[turn] == "onset"


def test_steps_of_one_nanometre_are_one_slow_motion():
    demand = np.round(np.arange(3000) * 0.2) * 1e-9  # 0.2 um/s: five samples a step
    assert len(split_phases(demand, PERIOD).strokes) == 1


def test_no_motion_has_neither_strokes_nor_moves():
    still = np.full(500, 0.01)
    assert (split_phases(still, PERIOD).phase == phases.REST).all()
    assert split_moves(recording(still), PERIOD) == ()


def test_moves_cover_the_recording_whether_listed_or_found():
    recorded = read_recording(DATA / "null-1.h5")
    listed = split_moves(recorded, PERIOD)
    found = split_moves(replace(recorded, moves=()), PERIOD)
    assert len(listed) == len(found) == len(recorded.moves)
    assert [b.kind for b in listed] == [b.kind for b in found]
    for a, b in zip(listed, found, strict=True):
        assert abs(a.moving - b.moving) <= 3
        assert abs(a.end - b.end) <= 3
    assert found[0].start == 0
    assert found[-1].stop == len(recorded)
    assert all(a.stop == b.start for a, b in pairwise(found))


def test_motion_without_rest_is_cut_where_it_turns():
    time = np.arange(6000) * PERIOD
    wave = split_moves(recording(0.05 * np.sin(2 * np.pi * time)), PERIOD)
    assert len(wave) == pytest.approx(12, abs=1)


def test_repeats_are_found_and_nothing_else():
    there = ramp(15e-3)
    lap = np.concatenate((there, there[::-1]))
    other = np.concatenate((ramp(14e-3), ramp(14e-3)[::-1]))
    made = recording(np.concatenate((lap, other, lap)))
    assert group_repeated_moves(made, split_moves(made, PERIOD)) == ((0, 4), (1, 5))
    recorded = read_recording(DATA / "null-1.h5")
    assert group_repeated_moves(recorded, split_moves(recorded, PERIOD)) == ()


@pytest.mark.parametrize(("second", "kinds"), [(15e-3, 1), (14.5e-3, 1), (9e-3, 2)])
def test_moves_are_of_another_kind_by_place_or_speed(second, kinds):
    laps = [np.concatenate((ramp(length), ramp(length)[::-1])) for length in (15e-3, second, 15e-3)]
    made = recording(np.concatenate(laps))
    moves = split_moves(made, PERIOD)
    pairs = [(one.start, other.stop) for one, other in zip(moves[::2], moves[1::2], strict=True)]
    assert kinds_of_moves(made, pairs) == [0, kinds - 1, 0]


def test_moves_of_a_recipe_are_of_many_kinds():
    recorded = read_recording(DATA / "null-1.h5")
    moves = split_moves(recorded, PERIOD)
    assert len(set(kinds_of_moves(recorded, [(m.start, m.stop) for m in moves]))) > 6
