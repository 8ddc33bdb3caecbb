"""Samples of SYNCs that were not where they belong: brought back, or left out."""

from dataclasses import replace

import numpy as np
import pytest

from stagectl.sequencer.samples.sample_validity import (
    PUNCTUAL,
    REACH,
    filled_to_grid,
    resampled_to_grid,
    without_late,
    without_stale,
    without_unpunctual,
)
from stagedata import Samples
from tests.unit.stagectl.sequencer.samples.jittered import COUNT, MOTION, TS, jittered


@pytest.mark.parametrize("most", [1e-5, 1e-4, 2.5e-4])
def test_samples_at_measured_instants_are_interpolated_to_the_grid(most):
    samples = jittered(most)
    placed = resampled_to_grid(without_unpunctual(samples, TS), TS)
    # the grid is where the middle SYNC was, which only shifts time
    shift = float(np.median(samples.sync)) - 5e-5
    position = MOTION.sample(np.clip(samples.time + shift, 0.0, None))[0]
    assert placed.valid.all()
    before = np.abs(samples.position[:, 0] - position).max()
    after = np.abs(placed.position[:, 0] - position).max()
    assert after < 5e-9
    assert before > 0.3 * most * 0.05  # 0.05 m/s
    force = 8.0 * MOTION.sample(np.clip(samples.time + shift, 0.0, None))[2]
    assert np.abs(placed.force[:, 0] - force).max() < 8.0 * 50.0 * 3e-4  # a corner of the jerk


def test_punctual_samples_are_not_touched():
    samples = jittered(1e-9)
    assert resampled_to_grid(samples, TS) is samples


def test_samples_beside_gaps_or_far_off_the_grid_are_invalid():
    samples = jittered(1e-4)
    samples.valid[[58, 59, 60, 61, 62, 64, 65, 66], 0] = False  # 63 has no neighbours
    samples.sync[100] += (REACH + 0.2) * TS
    placed = resampled_to_grid(samples, TS)
    lost = np.flatnonzero(samples.valid[:, 0] & ~placed.valid[:, 0])
    assert 100 in lost
    assert set(lost) == {63, 100}
    shift = float(np.median(samples.sync[samples.valid[:, 0]])) - 5e-5
    position = MOTION.sample(np.clip(samples.time + shift, 0.0, None))[0]
    ok = placed.valid[:, 0]
    assert np.abs(placed.position[ok, 0] - position[ok]).max() < 5e-9


def test_a_late_answer_does_not_matter_where_its_sync_is_known():
    samples = jittered(1e-5)
    samples.arrival[40:50] += 3e-4
    assert without_unpunctual(samples, TS).valid.all()
    unknown = jittered(1e-5, known=False)
    unknown.arrival[40:50] += 3e-4
    assert np.flatnonzero(~without_unpunctual(unknown, TS).valid[:, 0]).tolist() == list(
        range(40, 50)
    )


def test_samples_at_unknown_instants_are_invalid():
    samples = jittered(0.0, known=False)
    samples.arrival[:, 0] += np.random.default_rng(2).uniform(0.0, 8 * PUNCTUAL * TS, COUNT)
    assert without_unpunctual(samples, TS).valid.mean() < 0.5


def test_skipped_periods_stay_gaps():
    samples = jittered(1e-4)
    samples.time[80:] += 2 * TS
    whole = filled_to_grid(samples, TS)
    assert len(whole) == COUNT + 2
    assert np.flatnonzero(~whole.valid[:, 0]).tolist() == [80, 81]
    np.testing.assert_array_equal(whole.sync[82:], samples.sync[80:])


def test_repeated_samples_of_a_moving_axis_are_invalid():
    samples = jittered(0.0)
    samples.position[50:53], samples.force[50:53] = samples.position[49], samples.force[49]
    assert np.flatnonzero(~without_stale(samples).valid[:, 0]).tolist() == [50, 51, 52]


def test_an_axis_at_rest_may_repeat_itself():
    samples = jittered(0.0)
    samples.position[:, 0] = np.round(samples.position[:, 0], 9)
    assert (np.diff(samples.position[:, 0]) == 0.0).sum() > 20  # before and after the motion
    assert without_stale(samples).valid.all()


def test_after_a_gap_the_first_of_two_answers_is_that_of_an_earlier_sync():
    count = 10
    block = replace(
        Samples.missing(count, 1),
        valid=np.ones((count, 1), dtype=bool),
        time=TS * np.arange(count),
        arrival=np.full((count, 1), 2e-4),
    )
    block.extra[3] = 1  # one that was sent twice is as good as any
    block.valid[5:7] = False
    block.extra[8] = 1
    assert np.flatnonzero(~without_late(block).valid[:, 0]).tolist() == [5, 6, 7]
