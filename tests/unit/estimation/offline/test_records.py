"""Samples joined, and cut into blocks of samples that count."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.offline.records import (
    BLOCK,
    HOLE,
    LONGEST,
    OfflineSettings,
    Samples,
    joined,
    record,
)

TS, TRAVEL = 1e-3, 1e-3


def strokes(seconds=2.0, every=0.5):
    """To and fro over 10 mm, each stroke at constant speed, then at rest for a fifth of it."""
    time = np.arange(round(seconds / TS)) * TS
    phase = time / every
    way = np.minimum((phase % 1.0) / 0.8, 1.0)
    position = np.where(phase.astype(int) % 2, 10e-3 * (1.0 - way), 10e-3 * way)
    return Samples(position, np.ones(len(time)), np.ones(len(time), dtype=bool), 0.0, position)


def prepare(samples, peak_force=100.0):
    return record(samples, OfflineSettings(8.0, TS, 1e-9, 0.01, peak_force), TRAVEL)


def test_pieces_that_overlap_or_follow_are_one_and_a_gap_parts_them():
    whole = strokes()
    count = len(whole.position)

    def piece(begin, end):
        return Samples(
            whole.position[begin:end], whole.force[begin:end], whole.valid[begin:end],
            begin * TS, whole.demand[begin:end],
        )  # fmt: skip

    (together,) = joined([piece(0, 200), piece(198, 400), piece(400, count)], TS)
    np.testing.assert_array_equal(together.position, whole.position)
    assert len(joined([piece(0, 200), piece(230, count)], TS)) == 2
    assert len(joined([piece(0, 200), replace(piece(200, count), demand=None)], TS)) == 2


def test_blocks_cover_all_samples_and_end_at_rests():
    found = prepare(strokes())
    assert found.blocks[0][0] == 0
    assert found.blocks[-1][1] == len(found.velocity)
    for (_, end), (begin, _) in zip(found.blocks, found.blocks[1:], strict=False):
        assert begin == end
        assert np.abs(found.velocity[end - 5 : end - 2]).max() < 1e-9
    sizes = [(end - begin) * TS for begin, end in found.blocks[:-1]]
    assert min(sizes) >= BLOCK
    assert max(sizes) <= LONGEST


def test_without_a_rest_a_block_ends_at_the_longest_time():
    slide = np.arange(2000) * 1e-5
    found = prepare(Samples(slide, np.ones(2000), np.ones(2000, dtype=bool), 0.0, slide))
    assert found.blocks[0] == (0, round(LONGEST / TS))


def test_samples_count_in_motion_once_all_elements_have_slipped():
    found = prepare(strokes())
    moving = np.abs(found.velocity) > 1e-9
    assert not found.used[~moving & ~np.roll(moving, 4) & ~np.roll(moving, -4)].any()
    first = int(np.argmax(found.used))
    assert abs(found.position[first + 1]) == pytest.approx(TRAVEL, rel=0.1)
    assert found.used[100:300].all()


def test_a_hole_forgets_the_elements_and_a_lost_sample_does_not():
    whole = strokes()
    for lost, forgets in ((1, False), (HOLE + 1, True)):
        valid = whole.valid.copy()
        valid[200 : 200 + lost] = False
        found = prepare(replace(whole, valid=valid))
        after = found.used[200 + lost + 3 : 260]
        # TRAVEL takes 40 samples at 25 mm/s.
        assert after[:20].any() != forgets
        assert after[-5:].all()


def test_saturated_samples_do_not_count():
    whole = strokes()
    force = whole.force.copy()
    force[200] = -100.0
    used = prepare(replace(whole, force=force)).used
    assert not used[199]
    assert used[198]
    assert used[200]


def test_lengths_that_differ_and_nothing_valid():
    with pytest.raises(ValueError, match="length"):
        Samples(np.zeros(9), np.zeros(8), np.ones(9, dtype=bool), 0.0)
    with pytest.raises(ValueError, match="valid"):
        Samples(np.zeros(9), np.zeros(9), np.zeros(9, dtype=bool), 0.0)
