"""Samples of SYNCs that were not where they belong: brought back, or left out."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.trajectory import Limits, plan
from stagectl.sequencer.jolts import aside, kicked, upset
from stagectl.sequencer.samples import PUNCTUAL, REACH, MoveSamples

TS = 1e-3
MOTION = plan(0.0, 2e-3, Limits(0.05, 1.0, 50.0))
COUNT = 140


def jittered(most, seed=1, known=True):
    """A motion sampled at SYNCs up to `most` [s] off; force the acceleration times 8 kg."""
    off = np.random.default_rng(seed).uniform(-most, most, COUNT)
    at = TS * np.arange(COUNT) - 0.01
    position, _, acceleration = MOTION.sample(np.clip(at + off, 0.0, None))
    return MoveSamples(
        at, position[:, None], 8.0 * acceleration[:, None], np.ones((COUNT, 1), np.bool_),
        np.full((COUNT, 1), 2e-4), off + 5e-5, np.zeros(COUNT) if known else np.full(COUNT, np.inf),
    )  # fmt: skip


def truth():
    """Where the motion is on the grid [m], and its force [N]."""
    position, _, acceleration = MOTION.sample(np.clip(TS * np.arange(COUNT) - 0.01, 0.0, None))
    return position, 8.0 * acceleration


@pytest.mark.parametrize("most", [1e-5, 1e-4, 2.5e-4])
def test_samples_of_measured_instants_are_brought_back(most):
    samples = jittered(most)
    placed = samples.punctual(TS).placed(TS)
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
    assert samples.placed(TS) is samples


def test_gaps_and_far_ones_are_left_out():
    samples = jittered(1e-4)
    samples.valid[[58, 59, 60, 61, 62, 64, 65, 66], 0] = False  # 63 has no neighbours
    samples.sync[100] += (REACH + 0.2) * TS
    placed = samples.placed(TS)
    lost = np.flatnonzero(samples.valid[:, 0] & ~placed.valid[:, 0])
    assert 100 in lost
    assert set(lost) == {63, 100}
    shift = float(np.median(samples.sync[samples.valid[:, 0]])) - 5e-5
    position = MOTION.sample(np.clip(samples.time + shift, 0.0, None))[0]
    ok = placed.valid[:, 0]
    assert np.abs(placed.position[ok, 0] - position[ok]).max() < 5e-9


def test_an_answers_delay_does_not_matter_where_its_sync_is_known():
    samples = jittered(1e-5)
    samples.arrival[40:50] += 3e-4
    assert samples.punctual(TS).valid.all()
    unknown = jittered(1e-5, known=False)
    unknown.arrival[40:50] += 3e-4
    assert np.flatnonzero(~unknown.punctual(TS).valid[:, 0]).tolist() == list(range(40, 50))


def test_instants_that_are_not_known_teach_nothing():
    samples = jittered(0.0, known=False)
    samples.arrival[:, 0] += np.random.default_rng(2).uniform(0.0, 8 * PUNCTUAL * TS, COUNT)
    assert samples.punctual(TS).valid.mean() < 0.5


def test_periods_passed_over_keep_their_holes():
    samples = jittered(1e-4)
    samples.time[80:] += 2 * TS
    whole = samples.on_grid(TS)
    assert len(whole) == COUNT + 2
    assert np.flatnonzero(~whole.valid[:, 0]).tolist() == [80, 81]
    np.testing.assert_array_equal(whole.sync[82:], samples.sync[80:])


def test_data_that_a_drive_sends_again_are_no_new_samples():
    samples = jittered(0.0)
    samples.position[50:53], samples.force[50:53] = samples.position[49], samples.force[49]
    assert np.flatnonzero(~samples.fresh().valid[:, 0]).tolist() == [50, 51, 52]


def test_an_axis_at_rest_may_repeat_itself():
    samples = jittered(0.0)
    samples.position[:, 0] = np.round(samples.position[:, 0], 9)
    assert (np.diff(samples.position[:, 0]) == 0.0).sum() > 20  # before and after the motion
    assert samples.fresh().valid.all()


def test_a_force_behind_late_setpoints_says_nothing():
    samples = jittered(1e-5)
    samples.position[:, 0] = np.round(samples.position[:, 0], 9)
    assert not upset(samples, TS).any()  # what a drive's lock on SYNC takes
    samples.sync[3] += 2e-4  # at rest: nothing jumps
    samples.sync[50] += 1e-4
    samples.time[80:] += 3 * TS
    mask = upset(samples, TS)
    assert mask.shape == samples.on_grid(TS).position.shape
    where = np.flatnonzero(mask[:, 0])
    assert {49, 50, 52} < set(where) <= {*range(49, 58), *range(79, 94)}
    assert {*range(79, 87)} < set(where)  # the longer it stood still, the longer it takes


def test_behind_a_hole_a_force_that_was_not_to_be_expected_says_nothing():
    samples = jittered(0.0)
    samples.position[:, 0] = np.round(samples.position[:, 0], 9)
    samples.force[:, 0] = np.round(samples.force[:, 0] / 0.04) * 0.04
    samples.valid[[5, 50, 51, 54, 70]] = False  # lost on their way here
    assert not kicked(samples, TS).any()
    samples.force[52:56, 0] += [20.0, -9.0, 0.0, 1.0]  # 50 and 51: SYNC didn't reach the drive
    where = np.flatnonzero(kicked(samples, TS)[:, 0])
    assert {49, 50, 51, 52, 53, 54, 55} < set(where) <= {*range(49, 66)}
    samples.valid[:] = False
    assert not kicked(samples, TS).any()


def test_a_position_of_another_instant_is_told_by_the_force():
    samples = jittered(1e-5)
    rng = np.random.default_rng(3)
    samples.position[:, 0] += rng.normal(0.0, 1e-9, COUNT)
    placed = samples.placed(TS)
    assert not aside(placed, TS, [8.0]).any()
    placed.position[60, 0] += 2e-7  # 0.05 m/s for 4 us
    assert np.flatnonzero(aside(placed, TS, [8.0])[:, 0]).tolist() == [57, 58, 59, 60, 61, 62, 63]
    same = jittered(0.0)
    same.position[60, 0] += 2e-7
    assert not aside(same, TS, [8.0]).any()  # where SYNC is exact, it was no late SYNC
