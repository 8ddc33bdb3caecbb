"""What is kept of a stream, and what ends one."""

from dataclasses import replace

import numpy as np
import pytest

from stagectl.errors import RunFault
from stagectl.sequencer.compensation.known_axis import SAMPLES_BEFORE_MOVE
from stagectl.sequencer.streamer import FAULT_SAMPLES, Streamer, check_following_error
from stagedata import Samples
from tests.unit.stagectl.sequencer.echo import TS, Echo, Stuck

RAMP = np.linspace(0.0, 1e-3, 40)[:, None]
NO_OFFSET = np.zeros((40, 1))


def streamer_of(stage, stop=lambda: False):
    return Streamer(stage, ["x"], [1e-3], TS, stop)


def test_a_move_is_recorded_from_the_last_samples_at_rest():
    streamer = streamer_of(Echo())
    streamer.stream(np.zeros((10, 1)), np.zeros((10, 1)))
    streamer.begin_move()
    assert not streamer.has_record
    assert streamer.rest_force == [1.5]
    for half in (slice(0, 20), slice(20, 40)):
        assert streamer.stream(RAMP[half], NO_OFFSET[half]) == 20
    record = streamer.record()
    assert len(record) == SAMPLES_BEFORE_MOVE + 40
    np.testing.assert_array_equal(record.position[SAMPLES_BEFORE_MOVE:], RAMP)
    np.testing.assert_allclose(np.diff(record.time), TS)
    assert streamer.samples == 50
    assert streamer.time == pytest.approx(50 * TS)


def test_a_stop_ends_a_stream_but_not_the_way_to_rest():
    asked = []

    def stop():
        asked.append(True)
        return len(asked) == 7

    streamer = streamer_of(Echo(), stop)
    assert streamer.stream(RAMP, NO_OFFSET) == 7
    streamer.stream_to_rest(RAMP, NO_OFFSET)
    assert streamer.samples == 47
    assert len(asked) == 7


def test_what_is_waited_for_ends_a_stream_and_so_does_a_stop_meanwhile():
    streamer = streamer_of(Echo())
    assert streamer.stream(RAMP, NO_OFFSET, lambda at: at[0] > RAMP[11, 0]) == 13
    stopped = streamer_of(Echo(), lambda: True)
    assert stopped.stream(RAMP, NO_OFFSET, lambda _: False) == 1


def test_a_following_error_is_a_fault_that_names_axis_and_object():
    streamer = streamer_of(Stuck())
    streamer.stream(np.zeros((50, 1)), np.zeros((50, 1)))
    with pytest.raises(RunFault, match=r"^axis x: 0x6064:00 position actual: 2 mm from"):
        streamer.stream(np.zeros((50, 1)), np.zeros((50, 1)))


def test_after_a_fault_nothing_of_before_is_taken_for_the_next_move():
    streamer = streamer_of(Echo())
    streamer.begin_move()
    streamer.stream(RAMP, NO_OFFSET)
    streamer.restart(123)
    assert (streamer.samples, streamer.time, streamer.has_record) == (123, 0.0, False)
    streamer.begin_move()
    assert streamer.rest_force == [0.0]
    assert len(streamer.record()) == 0


COUNT = 60
DEMAND = np.column_stack([np.linspace(0.0, 0.01, COUNT), np.zeros(COUNT)])


def watched(outside, invalid=0):
    """Axis y is 2 mm off its demand in this many samples; the first of them invalid."""
    position = np.vstack([DEMAND[:1], DEMAND[:-1]])
    position[20 : 20 + outside, 1] += 2e-3
    valid = np.ones((COUNT, 2), dtype=bool)
    valid[20 : 20 + invalid, 1] = False
    samples = replace(Samples.missing(COUNT, 2), position=position, valid=valid)
    check_following_error(samples, DEMAND, ("x", "y"), (1e-3, 1e-3))


def test_a_few_samples_outside_the_window_are_no_fault():
    watched(0)  # each position is compared with the demand of the sample before
    watched(FAULT_SAMPLES - 1)
    watched(FAULT_SAMPLES + 4, invalid=5)


def test_the_fault_names_axis_object_and_window():
    with pytest.raises(RunFault, match=r"axis y: 0x6064:00 .* 2 mm .*following_error: 1 mm"):
        watched(FAULT_SAMPLES)
