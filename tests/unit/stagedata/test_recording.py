"""A recording checks that its parts fit, and knows the demand at the instants of its samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stagedata import AxisSignals, Move, Recording
from stagedata.recording import aligned_demand

COUNT = 10


def signals(demand=None, **changes):
    none = np.zeros(COUNT)
    own = AxisSignals(
        none if demand is None else np.asarray(demand, np.float64),
        none, none, none, None, np.ones(COUNT, dtype=np.bool_),
    )  # fmt: skip
    return replace(own, **changes)


def recording(*moves, **axes):
    return Recording("", "", "", np.arange(COUNT) * 1e-3, axes or {"x": signals()}, moves, "r.h5")


def move(start, end, **axes):
    ends = axes or {"x": (0.0, 1e-3)}
    return Move(
        "macro", start, end, {a: e[0] for a, e in ends.items()}, {a: e[1] for a, e in ends.items()}
    )


def test_channels_of_another_length_are_named():
    with pytest.raises(ValueError, match=r"^force_actual: shape \(9,\), position_demand has"):
        signals(force_actual=np.zeros(9))
    with pytest.raises(ValueError, match=r"^position_demand: must have one dimension"):
        signals(demand=np.zeros((COUNT, 2)))


def test_axes_have_as_many_samples_as_the_time():
    short = AxisSignals(*[np.zeros(9)] * 4, None, np.ones(9, dtype=np.bool_))
    with pytest.raises(ValueError, match=r"^axes/y: 9 samples, time has 10"):
        recording(x=signals(), y=short)
    with pytest.raises(ValueError, match=r"^axes: none"):
        Recording("", "", "", np.zeros(0), {}, (), "")


@pytest.mark.parametrize(("start", "end"), [(-1, 3), (4, 3), (5, 11)])
def test_a_move_outside_the_samples_is_named(start, end):
    with pytest.raises(ValueError, match=rf"^moves\[1\]: samples {start}\.\.{end} are not within"):
        recording(move(0, 3), move(start, end))


def test_a_move_names_all_axes_and_no_other():
    with pytest.raises(ValueError, match=r"^moves\[0\]: origin and target must name the axes"):
        recording(move(0, 3, x=(0.0, 0.0), y=(0.0, 0.0)))


def test_rest_lasts_to_the_next_move_or_the_end():
    whole = recording(move(1, 3), move(5, 7))
    assert [whole.rest_end(n) for n in (0, 1)] == [5, COUNT]
    assert whole.moves[0].distance("x") == pytest.approx(1e-3)


def test_the_demand_inside_the_drive_is_one_control_period_into_the_ramp():
    aligned = aligned_demand(signals([0, 0, 1, 3, 3, 3, 2, 2, 2, 2]), 0.1)
    np.testing.assert_allclose(aligned, [0, 0, 0.1, 1.2, 3, 3, 2.9, 2, 2, 2], atol=1e-15)


def test_at_rest_it_is_the_target_to_the_bit():
    target = 0.1 + 0.2  # whose differences round
    aligned = aligned_demand(signals([0.7] * 3 + [target] * 7), 0.1)
    assert (aligned[4:] == target).all()
