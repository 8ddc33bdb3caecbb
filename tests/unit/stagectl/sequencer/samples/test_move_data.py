"""One record per axis from the samples of a move, on an even grid, whatever came late."""

from dataclasses import fields, replace

import numpy as np

from stagectl.sequencer.samples.move_data import (
    late_setpoints,
    missed_syncs,
    outliers,
    prepare_move_data,
)
from stagectl.sequencer.samples.sample_validity import filled_to_grid, resampled_to_grid
from tests.unit.stagectl.sequencer.samples.jittered import COUNT, MOTION, TS, jittered


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


def test_a_clean_move_is_taken_as_it_is():
    samples = jittered(0.0)
    (record,), path = prepare_move_data(samples, np.array([1.5]), [8.0], TS)
    np.testing.assert_array_equal(record.position, samples.position[:, 0])
    np.testing.assert_array_equal(record.force, samples.force[:, 0])
    assert record.valid.all()
    assert (record.time, record.rest_force) == (samples.time[0], 1.5)
    np.testing.assert_array_equal(path[:, 0], samples.position[:, 0])


def test_samples_of_early_and_late_syncs_come_to_their_places():
    samples = jittered(1e-5)
    (record,), _ = prepare_move_data(samples, np.array([0.0]), [8.0], TS)
    on_grid = MOTION.sample(np.clip(samples.time, 0.0, None))[0]
    before = np.abs(samples.position[:, 0] - on_grid).max()
    placed = np.abs(record.position - on_grid)[record.valid].max()
    assert placed < 0.1 * before


def test_skipped_periods_are_gaps_that_the_path_bridges():
    samples = jittered(0.0)
    samples.time[80:] += 3 * TS
    (record,), path = prepare_move_data(samples, np.array([0.0]), [8.0], TS)
    assert len(record.position) == len(path) == COUNT + 3
    assert not record.valid[80:83].any()
    assert record.valid[83:].all()
    ends = path[79, 0], path[83, 0]
    np.testing.assert_allclose(path[80:83, 0], np.linspace(*ends, 5)[1:-1])


def test_every_axis_has_a_record_of_its_own():
    one = jittered(0.0)
    of_each = {f.name: getattr(one, f.name) for f in fields(one) if getattr(one, f.name).ndim == 2}
    both = replace(one, **{name: np.column_stack([of] * 2) for name, of in of_each.items()})
    both.valid[5, 1] = False
    records, path = prepare_move_data(both, np.array([1.0, 2.0]), [8.0, 14.0], TS)
    assert [r.rest_force for r in records] == [1.0, 2.0]
    assert [r.valid[5] for r in records] == [True, False]
    assert records[0].valid.all()
    assert path.shape == (COUNT, 2)


def test_a_force_that_a_late_setpoint_made_is_masked_not_lost():
    at = 60
    samples = jittered(1e-5)
    samples.position[:, 0] = np.round(samples.position[:, 0], 9)
    samples.sync[at] += 1e-4
    (record,), _ = prepare_move_data(samples, np.array([0.0]), [8.0], TS)
    assert record.disturbed is not None
    assert record.disturbed[at - 1 : at + 2].any()
    assert record.valid[at + 2 :].any()
