"""The cycle ledger: counted, and read back from a recording."""

import numpy as np

from stagectl.store import CycleLedger, read_ledger, write_recording
from tests.unit.stagectl.store.recordings import small_recording


def test_the_ledger_is_read_back(tmp_path):
    arrival = np.full(50, 2e-4)
    arrival[[7, 8]] = np.nan
    late = np.arange(50) == 9
    path = tmp_path / "r.h5"
    ledger = CycleLedger({"y": arrival, "x": np.full(50, 1e-4)}, late)
    write_recording(small_recording(), path, ledger)
    read = read_ledger(path)
    assert read is not None
    np.testing.assert_array_equal(read.arrival["y"], arrival)
    assert (read.missed, read.late_cycles) == (2, 1)
    assert list(read.missed_per_cycle[6:10]) == [0, 1, 1, 0]
