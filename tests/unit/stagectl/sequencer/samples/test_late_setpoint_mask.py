"""Samples whose force is left out of learning after late or lost setpoints."""

import numpy as np

from stagectl.sequencer.samples.late_setpoint_mask import late_setpoints, missed_syncs, outliers
from stagectl.sequencer.samples.sample_validity import filled_to_grid, resampled_to_grid
from tests.unit.stagectl.sequencer.samples.jittered import COUNT, TS, jittered


def test_the_force_after_late_setpoints_is_masked():
    samples = jittered(1e-5)
    samples.position[:, 0] = np.round(samples.position[:, 0], 9)
    assert not late_setpoints(samples, TS).any()  # what a drive's lock on SYNC takes
    samples.sync[3] += 2e-4  # at rest: nothing jumps
    samples.sync[50] += 1e-4
    samples.time[80:] += 3 * TS
    mask = late_setpoints(samples, TS)
    assert mask.shape == filled_to_grid(samples, TS).position.shape
    where = np.flatnonzero(mask[:, 0])
    assert {49, 50, 52} < set(where) <= {*range(49, 58), *range(79, 94)}
    assert {*range(79, 87)} < set(where)  # the longer it stood still, the longer it takes


def test_an_unexpected_force_after_a_missed_sync_is_masked():
    samples = jittered(0.0)
    samples.position[:, 0] = np.round(samples.position[:, 0], 9)
    samples.force[:, 0] = np.round(samples.force[:, 0] / 0.04) * 0.04
    samples.valid[[5, 50, 51, 54, 70]] = False  # lost on their way here
    assert not missed_syncs(samples, TS).any()
    samples.force[52:56, 0] += [20.0, -9.0, 0.0, 1.0]  # 50 and 51: SYNC didn't reach the drive
    where = np.flatnonzero(missed_syncs(samples, TS)[:, 0])
    assert {49, 50, 51, 52, 53, 54, 55} < set(where) <= {*range(49, 66)}
    samples.valid[:] = False
    assert not missed_syncs(samples, TS).any()


def test_a_position_that_contradicts_the_force_is_masked():
    samples = jittered(1e-5)
    rng = np.random.default_rng(3)
    samples.position[:, 0] += rng.normal(0.0, 1e-9, COUNT)
    placed = resampled_to_grid(samples, TS)
    assert not outliers(placed, TS, [8.0]).any()
    placed.position[60, 0] += 2e-7  # 0.05 m/s for 4 us
    assert np.flatnonzero(outliers(placed, TS, [8.0])[:, 0]).tolist() == list(range(57, 64))
    same = jittered(0.0)
    same.position[60, 0] += 2e-7
    assert not outliers(same, TS, [8.0]).any()  # where SYNC is exact, it was no late SYNC
