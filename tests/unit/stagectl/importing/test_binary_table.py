"""Columns of binary files: MATLAB's structures, matrices and version 7.3, NumPy, HDF5."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from stagectl.errors import UnusableInput
from stagectl.importing.binary_table import read_binary
from stagectl.importing.columns import Columns

Q = np.arange(20.0).reshape(10, 2)


def test_structures_and_matrices_are_named_as_in_matlab(tmp_path):
    path = tmp_path / "robot.mat"
    signals = [{"values": np.arange(10.0)}, {"values": -np.arange(10.0)}]
    log = {"q": Q, "t": np.arange(10.0), "name": "arm", "rate": 100.0}
    savemat(path, {"log": log, "tau": Q.T, "signals": np.array(signals, dtype=object)})
    found, _ = read_binary(path)
    named = "log.q(:,1) log.q(:,2) log.t tau(1,:) tau(2,:) signals(1).values signals(2).values"
    assert set(found) == set(named.split())
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
    found, _ = read_binary(path)
    assert set(found) == {"log.q(:,1)", "log.q(:,2)", "log.t"}
    np.testing.assert_array_equal(found["log.q(:,2)"], Q[:, 1])


def test_numpy_and_other_hdf5_files_are_named_alike(tmp_path):
    np.savez(tmp_path / "robot.npz", q=Q, t=np.arange(10.0), name="arm")
    with h5py.File(tmp_path / "robot.h5", "w") as file:
        file["log/q"] = Q
        file["log/t"] = np.arange(10.0)
        file["log/name"] = "arm"
    assert set(read_binary(tmp_path / "robot.npz")[0]) == {"q(:,1)", "q(:,2)", "t"}
    found, _ = read_binary(tmp_path / "robot.h5")
    assert set(found) == {"log.q(:,1)", "log.q(:,2)", "log.t"}
    np.testing.assert_array_equal(found["log.q(:,2)"], Q[:, 1])
    np.testing.assert_array_equal(Columns(tmp_path / "robot.npz")["q(:,2)"], Q[:, 1])


def test_pickled_objects_are_not_loaded(tmp_path):
    np.savez(tmp_path / "robot.npz", log=np.array([{"q": 1}], dtype=object))
    with pytest.raises(UnusableInput, match="objects of Python"):
        read_binary(tmp_path / "robot.npz")


def test_only_the_columns_wanted_are_read_and_all_are_named(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["q"], file["t"] = Q, np.arange(10.0)
        # Nobody has so much memory, and nothing of it is in the file.
        file.create_dataset("huge", (1 << 40,), "f8", chunks=(1 << 20,))
    np.savez(tmp_path / "a.npz", q=Q, t=np.arange(10.0), huge=np.zeros(3))
    savemat(tmp_path / "a.mat", {"q": Q, "t": np.arange(10.0), "huge": np.zeros(3)})
    for suffix in ("h5", "npz", "mat"):
        found, names = read_binary(tmp_path / f"a.{suffix}", ["q(:,2)", "none"])
        assert list(found) == ["q(:,2)"]
        np.testing.assert_array_equal(found["q(:,2)"], Q[:, 1])
        assert sorted(names) == ["huge", "q(:,1)", "q(:,2)", "t"]


@pytest.mark.parametrize("virtual", [True, False])
def test_data_in_another_file_are_refused(tmp_path, virtual):
    secret = tmp_path / "secret"
    np.arange(10.0).tofile(secret)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["t"] = np.arange(10.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["q"] = np.arange(10.0)
        if virtual:
            layout = h5py.VirtualLayout(shape=(10,), dtype="f8")
            layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "t", shape=(10,))
            file.create_virtual_dataset("t", layout)
        else:
            file.create_dataset("t", (10,), "f8", external=[(str(secret), 0, 80)])
    with pytest.raises(UnusableInput, match="/t: its data is in another file"):
        Columns(tmp_path / "a.h5", wanted=["t"])
    assert "q" in Columns(tmp_path / "a.h5", wanted=["q"])
