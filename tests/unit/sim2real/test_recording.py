"""The in-memory recording: its invariants."""

from __future__ import annotations

import numpy as np
import pytest

from stagedata import AxisSignals, Move, Recording, aligned_demand


def signals(length, **changed):
    zeros = np.zeros(length)
    fields = {
        "position_demand": zeros, "force_offset": zeros, "position_actual": zeros,
        "force_actual": zeros, "statusword": None, "valid": np.ones(length, dtype=bool),
    }  # fmt: skip
    return AxisSignals(**{**fields, **changed})


def recording(moves, length=10):
    return Recording("", "", "", np.arange(length) * 1e-3, {"x": signals(length)}, moves, "test")


def move(start, end):
    return Move("macro", start, end, {"x": 1e-3}, {"x": -2e-3})


def test_signals_have_one_length():
    with pytest.raises(ValueError, match=r"valid: shape \(9,\)"):
        signals(10, valid=np.ones(9, dtype=bool))
    with pytest.raises(ValueError, match="one dimension"):
        signals(10, position_demand=np.zeros((10, 2)))


def test_axes_are_as_long_as_the_time():
    with pytest.raises(ValueError, match="axes/x: 9 samples, time has 10"):
        Recording("", "", "", np.arange(10.0), {"x": signals(9)}, (), "test")
    with pytest.raises(ValueError, match="axes: none"):
        Recording("", "", "", np.arange(10.0), {}, (), "test")


@pytest.mark.parametrize(("start", "end"), [(-1, 3), (5, 4), (5, 11)])
def test_moves_lie_within_the_samples(start, end):
    with pytest.raises(ValueError, match=r"moves\[0\]"):
        recording((move(start, end),))


def test_a_move_names_every_axis():
    with pytest.raises(ValueError, match="must name the axes"):
        recording((Move("macro", 1, 2, {"y": 0.0}, {"y": 1.0}),))


def test_the_rest_ends_where_the_next_move_starts_or_with_the_samples():
    made = recording((move(1, 3), move(6, 8)))
    assert (made.rest_end(0), made.rest_end(1)) == (6, 10)
    assert made.moves[0].distance("x") == pytest.approx(-3e-3)


def test_aligned_demand_with_one_tick_per_period_is_the_demand():
    rng = np.random.default_rng(1)
    axis = signals(10, position_demand=rng.normal(size=10))
    np.testing.assert_allclose(aligned_demand(axis, 1.0), axis.position_demand, rtol=0, atol=1e-15)
    held = signals(10, position_demand=np.full(10, 0.1))
    assert (aligned_demand(held, 0.1) == 0.1).all()  # exactly: no rounding at rest
