"""Columns of binary files: MATLAB's structures, matrices and version 7.3, NumPy, HDF5."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from stagectl.errors import UnusableInput
from stagectl.importing.binary_table import read_arrays, read_matlab
from stagectl.importing.columns import Columns

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


def test_numpy_and_other_hdf5_files_are_named_alike(tmp_path):
    np.savez(tmp_path / "robot.npz", q=Q, t=np.arange(10.0), name="arm")
    with h5py.File(tmp_path / "robot.h5", "w") as file:
        file["log/q"] = Q
        file["log/t"] = np.arange(10.0)
        file["log/name"] = "arm"
    assert set(read_arrays(tmp_path / "robot.npz")) == {"q(:,1)", "q(:,2)", "t"}
    found = read_arrays(tmp_path / "robot.h5")
    assert set(found) == {"log.q(:,1)", "log.q(:,2)", "log.t"}
    np.testing.assert_array_equal(found["log.q(:,2)"], Q[:, 1])
    np.testing.assert_array_equal(Columns(tmp_path / "robot.npz")["q(:,2)"], Q[:, 1])


def test_pickled_objects_are_not_loaded(tmp_path):
    np.savez(tmp_path / "robot.npz", log=np.array([{"q": 1}], dtype=object))
    with pytest.raises(UnusableInput, match=r"not a readable \.npz file"):
        read_arrays(tmp_path / "robot.npz")
