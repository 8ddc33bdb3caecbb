"""Streams on a scripted bus: the frames sent, and the samples made of the answers."""

import itertools
import struct

import numpy as np
import pytest

from tests.unit.drivers.conftest import rest

X, Y = 0, 1


def test_enable_targets_the_actual_position_and_a_stream_returns_its_setpoints(stage, scripted):
    scripted.drives[X].position, scripted.drives[Y].position = 5_000, -7_000
    stage.enable()
    assert stage.targets == pytest.approx((5e-6, -7e-6))
    position, offset = rest(stage, 4)
    position[:, X] += np.arange(4) * 1.4e-9
    offset[:, Y] = 0.1234
    scripted.drives[X].force, scripted.drives[Y].force = 25, -50
    seen = []
    stage.sink = seen.append
    samples = stage.stream(position, offset)
    np.testing.assert_allclose(
        samples.position_demand[:, X], [5e-6, 5.001e-6, 5.003e-6, 5.004e-6], atol=1e-15
    )
    np.testing.assert_allclose(samples.force_offset[:, Y], 0.12)  # 2 x 60 N / 1000
    np.testing.assert_allclose(samples.time, [0, 1e-3, 2e-3, 3e-3])
    assert scripted.drives[Y].latched == (0x0F, -7000, 2)
    np.testing.assert_allclose(samples.force, np.tile((1.0, -3.0), (4, 1)))
    # the drive samples before it takes the setpoint over
    np.testing.assert_allclose(samples.position[1:, X], samples.position_demand[:-1, X])
    assert samples.valid.all()
    assert not samples.late.any()
    x, y = (5003, 0, 5001, 25, 0x227, 1, 0, 0), (-7000, 2, -7000, -50, 0x227, 1, 0, 0)
    assert seen[2] == (2_000_000, 0, 0, -1, *x, *y)


def test_streams_continue_the_sync_grid_and_until_ends_one(enabled, scripted):
    first = enabled.stream(*rest(enabled, 3))
    counted = []

    def until(position):
        counted.append(position)
        return len(counted) == 2

    second = enabled.stream(*rest(enabled, 50), until=until)
    assert len(second) == 2
    np.testing.assert_allclose(np.r_[first.time, second.time], np.arange(5) * 1e-3)
    syncs = [t for t, can_id, _ in scripted.sent if can_id == 0x80]
    assert set(np.diff(syncs[-5:])) == {1_000_000}


def test_late_cycles_are_counted_and_never_sent_in_a_burst(enabled, scripted):
    def slow(position):
        calls.append(position)
        if len(calls) == 3:
            scripted.clock.now += 3_700_000
        return False

    calls = []
    samples = enabled.stream(*rest(enabled, 6), until=slow)
    assert samples.late.tolist() == [False, False, False, True, False, False]
    np.testing.assert_allclose(samples.time, np.array([0, 1, 2, 5, 6, 7]) * 1e-3)
    syncs = [t for t, can_id, _ in scripted.sent if can_id == 0x80][-6:]
    assert min(np.diff(syncs)) >= 300_000
    assert enabled.late == 1


def test_a_copy_of_an_old_tpdo_is_not_taken_for_the_new_one(enabled, scripted):
    """Of the axis that answers last: its old frame would end the cycle before its new one."""
    count = itertools.count()

    def sink(sample):
        if next(count) == 2:
            scripted.deliver(0x182, struct.pack("<Hih", 0x227, sample[11] - 5, 0))

    enabled.sink = sink
    position, offset = rest(enabled, 6)
    position[:, Y] += np.arange(6) * 1e-7
    samples = enabled.stream(position, offset)
    expected = np.r_[samples.position[0, Y], samples.position_demand[:-1, Y]]
    expected[3] = expected[2]  # two that differ for SYNC 2: the next sample is not trusted
    np.testing.assert_allclose(samples.position[:, Y], expected)
    assert list(np.flatnonzero(~samples.valid[:, Y])) == [3]
    assert samples.valid[:, X].all()
