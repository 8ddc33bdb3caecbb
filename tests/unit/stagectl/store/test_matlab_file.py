"""Columns of MATLAB files: structures, matrices, and version 7.3."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from stagectl.errors import UnusableInput
from stagectl.store.columns import Columns
from stagectl.store.matlab_file import read_matlab

Q = np.arange(20.0).reshape(10, 2)


def test_structures_and_matrices_are_named_as_in_matlab(tmp_path):
    path = tmp_path / "robot.mat"
    signals = [{"values": np.arange(10.0)}, {"values": -np.arange(10.0)}]
    log = {"q": Q, "t": np.arange(10.0), "name": "arm", "rate": 100.0}
    savemat(path, {"log": log, "tau": Q.T, "signals": np.array(signals, dtype=object)})
    found = read_matlab(path)
    assert set(found) == {
        "log.q(:,1)", "log.q(:,2)", "log.t", "tau(1,:)", "tau(2,:)",
        "signals(1).values", "signals(2).values",
    }  # fmt: skip
    np.testing.assert_array_equal(found["log.q(:,2)"], Q[:, 1])
    np.testing.assert_array_equal(found["tau(2,:)"], Q[:, 1])
    np.testing.assert_array_equal(found["signals(2).values"], -np.arange(10.0))
    with pytest.raises(UnusableInput, match=r"no column 'q'; it has log\.q\(:,1\), log\.q\(:,2\)"):
        Columns(path)["q"]


def test_version_7_3_gives_the_same_names(tmp_path):
    path = tmp_path / "robot.mat"
    with h5py.File(path, "w") as file:
        file["log/q"] = Q.T  # MATLAB writes the last dimension first
        file["log/t"] = np.arange(10.0)[None, :]
        file["#refs#/a"] = Q
    found = read_matlab(path)
    assert set(found) == {"log.q(:,1)", "log.q(:,2)", "log.t"}
    np.testing.assert_array_equal(found["log.q(:,2)"], Q[:, 1])
