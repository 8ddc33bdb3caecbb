"""Settling statistics on constructed signals, to the definitions of docs/formats/run.md."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stagectl.recipe import SiteLimits
from stagectl.sequencer import MoveResult, arrival, judge, statistics, summarise_moves
from stagectl.sequencer.settling import peak_error, settling
from stagectl.store import read_recording
from stagedata import AxisSignals, Move, Recording, aligned_demand

TS, TC = 1e-3, 1e-4
DATA = Path(__file__).parents[3] / "data"


def signals(demand, error=None, valid=None):
    """An axis whose position is its aligned demand minus `error`."""
    zeros = np.zeros(len(demand))
    blank = AxisSignals(demand, zeros, demand, zeros, None, np.ones(len(demand), dtype=bool))
    position = aligned_demand(blank, TC / TS) - (zeros if error is None else error)
    return AxisSignals(
        demand, zeros, position, zeros, None, blank.valid if valid is None else valid
    )


def recording(moves, **axes):
    length = len(next(iter(axes.values())))
    return Recording("", "", "", np.arange(length) * TS, axes, moves, "constructed")


def ramp(length, start, steps, target):
    """Demand 0, then `steps` equal steps from sample `start` on, the last one reaching target."""
    k = np.arange(length)
    return np.round(np.clip((k - start + 1) / steps, 0, 1) * target * 1e9) * 1e-9


def test_aligned_demand_is_one_control_tick_into_the_step():
    demand = np.array([2e-6, 2e-6, 12e-6, 12e-6])
    np.testing.assert_allclose(
        aligned_demand(signals(demand), 0.1), [2e-6, 2e-6, 3e-6, 12e-6], rtol=0, atol=1e-18
    )


def test_arrival_is_the_first_sample_whose_aligned_demand_is_the_target():
    demand = ramp(40, 10, 5, 1e-5)  # last step at sample 14
    assert demand[14] == pytest.approx(1e-5)
    assert arrival(demand, 1e-5, 10, 40) == 15


def test_arrival_allows_for_rounding_but_not_for_a_last_step_of_one_nanometre():
    demand = np.array([0, 0, 3, 6, 8, 9, 9, 9]) * 1e-9
    # The target is not on the grid; aligned demand at sample 5 is 8.1 nm, only 0.5 nm away.
    assert arrival(demand, 8.6e-9, 2, 8) == 6


@pytest.mark.parametrize("start", [0, 1])
def test_a_demand_at_its_target_arrives_at_once(start):
    assert arrival(np.full(5, 1e-6), 1e-6, start, 5) == start


def test_no_arrival_when_the_demand_stops_short():
    assert arrival(ramp(40, 10, 5, 1e-5), 2e-5, 10, 40) is None


@pytest.mark.parametrize(
    ("outside", "seconds", "settled"),
    [
        ([], 0.0, True),
        ([0], 0.001, True),
        ([0, 6], 0.007, True),  # in between it was inside: the last one counts
        ([9], 0.010, False),  # at its last sample: the whole time
        ([0, 9], 0.010, False),
    ],
)
def test_settling_counts_from_arrival_to_the_last_sample_outside(outside, seconds, settled):
    position = np.zeros(30)
    position[:12] = 1.0  # before arrival nothing counts
    position[22:] = 1.0  # nor after the start of the next move
    position[[12 + k for k in outside]] = -6e-8
    result = settling(position, np.ones(30, dtype=bool), 0.0, 12, 22, 5e-8, TS)
    assert result == (seconds, settled)


def test_a_sample_on_the_edge_of_the_window_is_inside():
    position = np.full(10, 5e-8)
    assert settling(position, np.ones(10, dtype=bool), 0.0, 0, 10, 5e-8, TS) == (0.0, True)


def test_missed_samples_are_left_out():
    position = np.zeros(10)
    position[[3, 9]] = 1e-6
    valid = np.ones(10, dtype=bool)
    valid[[3, 9]] = False
    assert settling(position, valid, 0.0, 0, 10, 5e-8, TS) == (0.0, True)
    position[4] = 1e-6
    assert settling(position, valid, 0.0, 0, 10, 5e-8, TS) == (0.005, True)
    assert settling(position, np.zeros(10, dtype=bool), 0.0, 0, 10, 5e-8, TS) == (0.01, False)


def test_peak_error_is_of_the_valid_samples_while_the_demand_moves():
    position = np.array([9.0, 1.0, -2.0, 8.0, 9.0])
    valid = np.array([True, True, True, False, True])
    assert peak_error(position, np.zeros(5), valid, 1, 4) == 2.0
    assert np.isnan(peak_error(position, np.zeros(5), np.zeros(5, dtype=bool), 1, 4))


def test_every_axis_of_a_move_has_a_result_and_its_rest_ends_at_the_next_move():
    x, y = ramp(100, 10, 20, 1e-4), ramp(100, 60, 10, 5e-5)
    error_x, error_y = np.zeros(100), np.zeros(100)
    error_x[20] = 3e-7
    error_x[35:38] = 1e-7  # 30 is the arrival: 8 ms to 50 nm, 0 to 200 nm
    error_x[70] = 5e-7  # in the next move, which x does not take part in
    error_y[99] = 3e-7
    moves = (
        Move("macro", 10, 30, {"x": 0.0, "y": 0.0}, {"x": 1e-4, "y": 0.0}, 1),
        Move("micro", 60, 70, {"x": 1e-4, "y": 0.0}, {"x": 1e-4, "y": 5e-5}, 1),
    )
    first, second = summarise_moves(
        recording(moves, x=signals(x, error_x), y=signals(y, error_y)), TC, TS
    )
    assert (first.axis, first.kind, first.site, first.settled) == ("x", "macro", 1, True)
    assert first.distance == pytest.approx(1e-4)
    assert first.peak_error == pytest.approx(3e-7)
    assert first.settling == {5e-8: 0.008, 2e-7: 0.0}
    assert (second.axis, second.settled) == ("y", False)
    assert second.settling == {5e-8: 0.030, 2e-7: 0.030}  # arrival 70, last sample 99


def test_an_interrupted_move_is_marked_and_left_out_of_the_statistics():
    demand = ramp(50, 10, 20, 1e-4)
    demand[20:] = demand[20]
    move = Move("macro", 10, 21, {"x": 0.0}, {"x": 1e-4}, 1)
    results = summarise_moves(recording((move,), x=signals(demand)), TC, TS)
    assert [(r.completed, r.settled) for r in results] == [(False, False)]
    assert statistics(results, "macro").count == 0


def test_statistics_over_axes_and_moves():
    def result(axis, seconds, peak):
        return MoveResult(0, 1, axis, "micro", 1e-5, peak, {5e-8: seconds}, True, True)

    results = [result("x", s / 1000, s * 1e-9) for s in range(10)] + [result("y", 0.1, 1e-6)]
    both = statistics(results, "micro")
    assert both.count == 11
    assert both.settling_median[5e-8] == pytest.approx(0.005)
    assert both.settling_mean[5e-8] == pytest.approx(0.145 / 11)
    assert both.settling_p90[5e-8] == pytest.approx(0.009)
    assert both.peak_error_median == pytest.approx(5e-9)
    assert statistics(results, "macro").peak_error_median is None


def test_the_uncompensated_reference_recordings_settle_as_their_makers_measured():
    """docs/reference/reference-stage.md, last table, `mass only`: medians over three recordings."""
    results = [
        r
        for name in ("null-1", "null-2", "null-3")
        for r in summarise_moves(read_recording(DATA / f"{name}.h5"), TC, TS)
    ]
    micro, macro = statistics(results, "micro"), statistics(results, "macro")
    assert all(r.completed for r in results)
    assert 0.120 <= micro.settling_median[5e-8] <= 0.150
    assert 0.075 <= micro.settling_median[2e-7] <= 0.100
    assert 0.110 <= macro.settling_median[5e-8] <= 0.130
    assert 4e-6 <= (micro.peak_error_median or 0) <= 9e-6


RECORDING = read_recording(Path(__file__).parents[3] / "data" / "null-1.h5")
MOVES = tuple(replace(m, site=1 + i // 2) for i, m in enumerate(RECORDING.moves))
SITED = replace(RECORDING, moves=MOVES)


def verdicts(**limits):
    return judge(SITED, SiteLimits(**limits), 5e-8, 1e-4, 1e-3)


def test_without_limits_there_is_no_verdict():
    assert verdicts() == ()


def test_a_site_passes_wide_limits_and_fails_tight_ones():
    wide = verdicts(peak_error=1e-3)
    assert [v.site for v in wide] == list(range(1, 20))
    assert not any(v.failures for v in wide)
    tight = verdicts(peak_error=1e-9)
    assert all(v.failures for v in tight)
    assert "peak error" in tight[0].failures[0]


def test_settling_is_judged_on_the_micro_move_late_or_never():
    # Without friction compensation some axis takes longer than that at most sites, not at all.
    some, none = verdicts(settling=0.14), verdicts(settling=1e3)
    assert 0 < sum(bool(v.failures) for v in some) < len(some)
    said = [text for v in some for text in v.failures]
    late = [text for text in said if "settled in" in text]
    assert late
    assert all(float(text.split()[3]) >= 140 for text in late)
    never = [text for v in none for text in v.failures]
    assert len(never) < len(none)
    assert all(text.endswith("did not settle") for text in never)
    assert len(said) == len(late) + len(never)


def test_a_site_that_was_repeated_is_judged_on_its_last_visit():
    kinds = ("macro", "micro") * 2
    visits = [
        replace(m, site=1, kind=kind) for m, kind in zip(RECORDING.moves[:4], kinds, strict=True)
    ]
    said = [
        judge(replace(RECORDING, moves=tuple(moves)), SiteLimits(None, 1e-9), 5e-8, 1e-4, 1e-3)
        for moves in (visits[:2], visits[2:], visits)
    ]
    assert said[0] != said[1] == said[2]
