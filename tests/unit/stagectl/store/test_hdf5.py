"""HDF5 files of other programs: every problem is one line with file and place."""

import h5py
import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.store.hdf5 import (
    open_group,
    open_hdf5,
    read_array,
    read_floats,
    read_integers,
    read_line,
    read_text,
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.h5"


def made(path, make):
    with h5py.File(path, "w") as file:
        make(file)
    return path


def problem(path, read):
    with pytest.raises(UnusableInput) as caught, open_hdf5(path) as file:
        read(file)
    return str(caught.value).removeprefix(f"{path}: ")


def test_text_attributes(path):
    def make(file):
        file.attrs["bytes"] = np.bytes_("plain")
        file.attrs["lines"] = "a\nb"

    with open_hdf5(made(path, make)) as file:
        assert read_text(file, "bytes") == "plain"
        assert read_text(file, "none", default="") == ""
        assert read_text(file, "lines") == "a\nb"
    assert problem(path, lambda f: read_text(f, "none")) == "attribute none: missing"
    assert "control character U+000A" in problem(path, lambda f: read_line(f, "lines"))


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda f: f.create_group("x"), "/x: must be a dataset"),
        (lambda f: f.create_dataset("x", data=np.zeros((2, 2))), "/x: must have one dimension"),
        (lambda f: f.create_dataset("x", data=np.zeros(9)), "/x: 9 entries, at most 8 are read"),
        (lambda f: f.__setitem__("x", h5py.ExternalLink("b.h5", "/x")), "/x: is a link to another"),
    ],
)
def test_what_is_no_array_of_numbers(path, make, reason):
    made(path, make)
    assert problem(path, lambda f: read_array(f, "x", "f", 8)).startswith(reason)


def test_figures_are_read_as_64_bits(path):
    def make(file):
        file["axes/f"] = np.array([1.0, np.nan, 3.0], dtype=np.float32)
        file["axes/i"] = np.array([1, 2, 3], dtype=np.int16)

    with open_hdf5(made(path, make)) as file:
        group = open_group(file, "axes")
        assert read_floats(group, "f", finite=False).dtype == np.float64
        assert read_integers(group, "i", 3).tolist() == [1, 2, 3]
        assert read_floats(group, "i").tolist() == [1.0, 2.0, 3.0]
    assert "wrong kind" in problem(path, lambda f: read_integers(f["axes"], "f"))
