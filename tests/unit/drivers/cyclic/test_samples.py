"""Raw samples in order, completed by TPDOs that came late, and in SI units."""

from array import array
from types import SimpleNamespace

import numpy as np
import pytest

from drivers.cyclic.samples import FIELDS, HEAD, VALID, SampleWriter, decode_rows

X = SimpleNamespace(increment=1e-9, force_unit=0.04)
Y = SimpleNamespace(increment=2e-9, force_unit=0.05)
LATE_TPDO = (0x1237, 5000, 30, 1_200_000)
"""Statusword, position [counts], force [1/1000], arrival [ns]."""


def sample(number, *valid):
    """One SYNC of axes that each did or did not answer in time."""
    head = [number * 1_000_000, 0, 10, -1]
    return head + [
        value
        for axis, v in enumerate(valid)
        for value in (100 * axis, 7, 200 * axis, 9, 0x0237, int(v), 300 if v else -1, 0)
    ]


@pytest.fixture
def channels():
    return [SimpleNamespace(tardy=None, previous_tardy=None) for _ in range(2)]


@pytest.fixture
def sunk():
    return []


def written(rows):
    return np.array(rows).reshape(-1, HEAD + 2 * FIELDS)


def test_complete_samples_pass_at_once(channels, sunk):
    rows = array("q")
    writer = SampleWriter(channels, rows, sunk.append, waits=True)
    writer.write(sample(0, True, True), complete=True)
    assert sunk == [tuple(sample(0, True, True))]
    assert written(rows).tolist() == [sample(0, True, True)]


def test_a_tpdo_that_comes_before_the_next_sync_completes_its_own_sample(channels, sunk):
    rows = array("q")
    writer = SampleWriter(channels, rows, sunk.append, waits=True)
    writer.write(sample(0, True, False), complete=False)
    assert sunk == []
    channels[1].previous_tardy = LATE_TPDO
    channels[0].previous_tardy = LATE_TPDO  # of an axis that has answered: a copy
    writer.write(sample(1, True, True), complete=True)
    assert [s[0] for s in sunk] == [0, 1_000_000]
    late = sunk[0][HEAD + FIELDS :]
    assert late[2:7] == (5000, 30, 0x1237, 1, 1_200_000)
    assert late[:2] == (100, 7)
    assert sunk[0][: HEAD + FIELDS] == tuple(sample(0, True, False)[: HEAD + FIELDS])


def test_the_last_sample_is_flushed_once(channels, sunk):
    writer = SampleWriter(channels, array("q"), sunk.append, waits=True)
    writer.write(sample(0, False, True), complete=False)
    channels[0].tardy = LATE_TPDO
    writer.flush()
    writer.flush()
    assert len(sunk) == 1
    assert sunk[0][HEAD + VALID] == 1


def test_without_tardy_tpdos_nothing_waits(channels, sunk):
    writer = SampleWriter(channels, array("q"), sunk.append, waits=False)
    writer.write(sample(0, False, True), complete=False)
    assert len(sunk) == 1


def test_rows_decode_to_si_units_with_what_is_missing_marked():
    rows = array("q", [*sample(0, True, True), *sample(2, False, True)])
    found = decode_rows(rows, [X, Y])
    assert found.time == pytest.approx([0.0, 2e-3])
    assert found.position_demand[1] == pytest.approx([0.0, 200e-9])
    assert found.position[1] == pytest.approx([0.0, 400e-9])
    assert found.force[0] == pytest.approx([0.36, 0.45])
    assert found.force_offset[0] == pytest.approx([0.28, 0.35])
    assert found.valid.tolist() == [[True, True], [False, True]]
    assert np.isnan(found.arrival[1, 0])
    assert found.arrival[1, 1] == pytest.approx(300e-9)
    assert np.isinf(found.doubt).all()
