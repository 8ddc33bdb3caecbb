"""Samples kept for the scope, and their export."""

import csv
import io

import h5py
import numpy as np
import pytest

from stagectl.console.samples import KEPT, PER_AXIS, SampleRing, as_csv, as_hdf5, columns
from tests.unit.stagectl.console.fake_server import block

NAMES = columns(["x", "y"])


def filled(*blocks, share=0.0):
    ring = SampleRing(share)
    for each in blocks:
        ring.append(each)
    return ring


def row(stretch, name):
    return stretch.values[NAMES.index(name)]


def ramp(first, count):
    made = block(first, count)
    made.demand[:, 0] = 1e-6 * (first + np.arange(count))
    made.position[:, 0] = made.demand[:, 0]
    return made


@pytest.mark.parametrize(("share", "lag"), [(0.0, 1.0), (0.25, 0.75)])
def test_error_is_of_the_demand_that_the_sample_is_compared_with(share, lag):
    """d_k = r_{k-1} + (r_k - r_{k-1}) Tc/Ts, over the border of blocks, too."""
    error = row(filled(ramp(0, 10), ramp(10, 10), share=share).since(0), "x.error")
    assert np.isnan(error[0])
    np.testing.assert_allclose(error[1:], -1e-6 * lag, atol=1e-15)


def test_a_gap_and_missed_samples_are_not_a_number():
    late = ramp(30, 10)
    late.valid[3, 0] = 0
    stretch = filled(ramp(0, 10), late).since(0)
    position = row(stretch, "x.position")
    assert stretch.first == 0
    assert np.flatnonzero(np.isnan(position)).tolist() == [*range(10, 30), 33]
    assert not np.isnan(row(stretch, "y.position")[33])


def test_the_latest_are_kept():
    ring = filled(*(ramp(n, 1000) for n in range(0, KEPT + 5000, 1000)))
    stretch = ring.since(0)
    assert (stretch.first, stretch.values.shape[1]) == (5000, KEPT)
    np.testing.assert_allclose(row(stretch, "x.demand"), 1e-6 * np.arange(5000, KEPT + 5000))
    assert ring.since(ring.end).values.shape[1] == 0
    assert ring.since(ring.end - 5, 2).values.shape[1] == 2


def test_another_server_begins_anew():
    stretch = filled(ramp(5000, 10), ramp(0, 10)).since(0)
    assert (stretch.first, stretch.values.shape[1]) == (0, 10)


def test_exports_have_all_samples_with_units():
    late = ramp(0, 50)
    late.valid[7, 1] = 0
    stretch = filled(late).since(0)
    rows = list(csv.reader(io.StringIO(as_csv(stretch, NAMES).decode())))
    assert rows[0][:5] == ["sample", "time [s]", "late [1]", "x.demand [m]", "x.position [m]"]
    assert len(rows) == 51
    assert rows[8][rows[0].index("y.force [N]")] == ""
    with h5py.File(io.BytesIO(as_hdf5(stretch, NAMES, "a stage"))) as file:
        assert set(file["x"]) == set(PER_AXIS)
        np.testing.assert_array_equal(file["x/demand"][:], row(stretch, "x.demand"))
        assert file["x/force"].attrs["unit"] == "N"
        assert np.isnan(file["y/force"][7])
