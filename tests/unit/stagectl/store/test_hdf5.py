"""HDF5 files of other programs: every problem is one line with file and place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.store.hdf5 import (
    check_unit,
    member_names,
    open_group,
    open_hdf5,
    read_array,
    read_floats,
    read_integers,
    read_line,
    read_text,
)

Make = Callable[[h5py.File], object]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.h5"


def made(path: Path, make: Make) -> Path:
    with h5py.File(path, "w") as file:
        make(file)
    return path


def problem(path: Path, read: Make) -> str:
    with pytest.raises(UnusableInput) as caught, open_hdf5(path) as file:
        read(file)
    return str(caught.value).removeprefix(f"{path}: ")


def test_a_folder_names_the_recording_inside(tmp_path: Path) -> None:
    (tmp_path / "recording.h5").write_bytes(b"")
    assert problem(tmp_path, lambda f: None).startswith("is not a file; ")
    assert problem(tmp_path / "none.h5", lambda f: None) == "no such file"
    assert problem(tmp_path / "recording.h5", lambda f: None).startswith("not a readable HDF5 file")


def test_any_failure_while_reading_names_the_file(path: Path) -> None:
    made(path, lambda f: f.create_group("g"))
    assert problem(path, lambda f: f["none"]).startswith("not a readable HDF5 file")


def test_text_attributes(path: Path) -> None:
    def make(file: h5py.File) -> None:
        file.attrs["name"] = "µ"
        file.attrs["bytes"] = np.bytes_("plain")
        file.attrs["broken"] = np.bytes_(b"\xff\xfe")
        file.attrs["number"] = 3
        file.attrs["lines"] = "a\nb"

    with open_hdf5(made(path, make)) as file:
        assert (read_text(file, "name"), read_text(file, "bytes")) == ("µ", "plain")
        assert read_text(file, "none", default="") == ""
        assert read_text(file, "lines") == "a\nb"
    assert problem(path, lambda f: read_text(f, "none")) == "attribute none: missing"
    assert problem(path, lambda f: read_text(f, "number")) == "attribute number: must be text"
    assert problem(path, lambda f: read_text(f, "broken")) == "attribute broken: not UTF-8 text"
    assert "control character U+000A" in problem(path, lambda f: read_line(f, "lines"))


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda f: None, "/x: missing"),
        (lambda f: f.create_group("x"), "/x: must be a dataset"),
        (lambda f: f.create_dataset("x", data=np.zeros((2, 2))), "/x: must have one dimension"),
        (lambda f: f.create_dataset("x", data=np.array([b"a"])), "/x: holds |S1, which is of the"),
        (lambda f: f.create_dataset("x", data=np.zeros(9)), "/x: 9 entries, at most 8 are read"),
        (lambda f: f.__setitem__("x", h5py.ExternalLink("b.h5", "/x")), "/x: is a link to another"),
    ],
)
def test_what_is_no_array_of_numbers(path: Path, make: Make, reason: str) -> None:
    made(path, make)
    assert problem(path, lambda f: read_array(f, "x", "f", 8)).startswith(reason)


def test_samples_have_the_length_of_the_time_and_are_finite(path: Path) -> None:
    def make(file: h5py.File) -> None:
        group = file.create_group("axes")
        group.create_dataset("f", data=np.array([1.0, np.nan, 3.0], dtype=np.float32))
        group.create_dataset("i", data=np.array([1, 2, 3], dtype=np.int16))

    made(path, make)
    with open_hdf5(path) as file:
        group = open_group(file, "axes")
        assert read_floats(group, "f", finite=False).dtype == np.float64
        assert read_integers(group, "i", 3).tolist() == [1, 2, 3]
        assert read_floats(group, "i").tolist() == [1.0, 2.0, 3.0]
    assert problem(path, lambda f: read_floats(f["axes"], "f")) == "/axes/f: sample 1: is nan"
    wrong = problem(path, lambda f: read_integers(f["axes"], "i", 4))
    assert wrong == "/axes/i: 3 samples, /time has 4"
    assert "wrong kind" in problem(path, lambda f: read_integers(f["axes"], "f"))


def test_another_unit_is_refused_and_none_is_taken_for_si(path: Path) -> None:
    def make(file: h5py.File) -> None:
        file.create_dataset("plain", data=np.zeros(2))
        file.create_dataset("mm", data=np.zeros(2)).attrs["unit"] = "mm"

    made(path, make)
    with open_hdf5(path) as file:
        check_unit(file, "plain", "m")
    assert problem(path, lambda f: check_unit(f, "mm", "m")) == (
        "/mm: attribute unit is 'mm', must be 'm'"
    )


def test_names_are_shown_so_they_have_no_control_characters(path: Path) -> None:
    made(path, lambda f: f.create_group("x\x1b[31m"))
    assert "U+001B" in problem(path, lambda f: list(member_names(f)))
    assert problem(path, lambda f: open_group(f, "none")) == "/none: missing"
