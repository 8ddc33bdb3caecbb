"""Recordings on disk: round trip, other programs' files, and every way to be unusable."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from stagectl.errors import StagectlError, UnusableInput
from stagectl.store import read_ledger, read_recording, write_recording
from tests.unit.stagectl.store.recordings import small_recording

DATA = Path(__file__).parents[3] / "data"


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "recording.h5"
    write_recording(small_recording(), path)
    return path


def test_round_trip_keeps_every_sample_the_moves_and_the_order_of_axes(path):
    made, read = small_recording(), read_recording(path)
    assert (read.machine, read.recipe, read.started) == (made.machine, "", made.started)
    assert read.moves == made.moves
    assert read_ledger(path) is None
    assert list(read.axes) == ["y", "x"]
    np.testing.assert_array_equal(read.time, made.time)
    for name, signals in made.axes.items():
        for field in signals.__slots__:
            np.testing.assert_array_equal(getattr(read.axes[name], field), getattr(signals, field))


def test_every_dataset_has_a_unit_and_no_part_file_remains(path):
    lacking = []
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: (
                lacking.append(name)
                if isinstance(item, h5py.Dataset) and "unit" not in item.attrs
                else None
            )
        )
        assert file["axes/x/force_actual"].attrs["unit"] == "N"
    assert lacking == []
    assert [p.name for p in path.parent.iterdir()] == ["recording.h5"]


@pytest.mark.parametrize("name", ["null-1", "null-1-other-moves", "null-2", "null-3"])
def test_recordings_of_another_program_can_be_read(name):
    recording = read_recording(DATA / f"{name}.h5")
    assert list(recording.axes) == ["x", "y"]
    assert len(recording.moves) == 38
    assert recording.moves[0].site is None
    assert recording.axes["x"].valid.all()  # absent means all valid
    assert recording.machine.startswith("# The reference stage")


def test_unknown_groups_and_attributes_are_ignored(path):
    with h5py.File(path, "a") as file:
        file.attrs["colour"] = "blue"
        file["axes/x/temperature"] = np.zeros(3)
        file.create_group("vendor/deep")
    assert len(read_recording(path)) == 50


def put(name, values):
    """A change of a recording: this in place of a dataset; None: nothing."""

    def change(file):
        if name in file:
            del file[name]
        if values is not None:
            file[name] = values

    return change


def said(attribute, value, place="/"):
    """A change of a recording: another attribute."""
    return lambda file: file[place].attrs.__setitem__(attribute, value)


def moves_with(column, value, kind="S8"):
    row = {"kind": b"macro", "start": 1, "end": 9, "from_x": 0.0, "from_y": 0.0}
    row |= {"to_x": 0.0, "to_y": 0.0, column: value}
    kinds = [(k, kind if k == "kind" else "i8" if k in ("start", "end") else "f8") for k in row]
    return np.array([tuple(row.values())], dtype=kinds)


Y = "axes/y/position_actual"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("time", None), "/time: missing"),
        (put("time", np.zeros(50)), "/time: sample 1: not later"),
        (put("moves", None), "/moves: missing"),
        (put("moves", np.zeros(3)), "/moves: holds float64"),
        (put("moves", moves_with("kind", b"jump")), "/moves: row 0: kind 'jump'"),
        (put("moves", moves_with("kind", 1, "i8")), "/moves: row 0: kind ''"),
        (put("moves", moves_with("end", 51)), "/moves: row 0: samples 1..51"),
        (put("moves", moves_with("to_y", np.inf)), "/moves: row 0: a non-finite position"),
        (put("axes", None), "/axes: missing"),
        (put("axes/y", np.zeros(50)), "/axes/y: must be a group"),
        (put(Y, None), f"/{Y}: missing"),
        (put(Y, np.zeros(49)), f"/{Y}: 49 samples, /time"),
        (said("unit", "mm", Y), f"/{Y}: attribute unit is 'mm', must be 'm'"),
        (put("axes/y/force_actual", np.where(np.arange(50) == 7, np.nan, 0)), "sample 7: is nan"),
        (put(Y, np.zeros(50, "S3")), f"/{Y}: holds |S3"),
        (put("axes/y/valid", np.zeros(50)), "/axes/y/valid: holds float64"),
        (lambda file: file.move("axes/x", "axes/x\x1b"), "the control character U+001B"),
        (said("format", "something-else"), "attribute format"),
        (said("version", 2), "version: 2 is newer"),
        (said("version", "1\n2"), "attribute version: must be a whole number"),
        (said("machine", 5), "attribute machine: must be text"),
        (said("machine", b"\xff\xfe"), "attribute machine: not UTF-8"),
        (said("started", "2026\x1b[31m"), "started"),
        (said("format", "a\nb"), "format"),
    ],
)
def test_an_unusable_recording_is_one_line_naming_file_and_place(path, change, message):
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(UnusableInput) as failure:
        read_recording(path)
    text = str(failure.value)
    assert text.startswith(f"{path}: ")
    assert message in text
    assert text.isprintable()


def test_what_cannot_be_read_or_written_is_one_line(tmp_path):
    with pytest.raises(UnusableInput, match="no such file"):
        read_recording(tmp_path / "absent.h5")
    with pytest.raises(UnusableInput, match="is not a file"):
        read_recording(tmp_path)
    with pytest.raises(StagectlError, match="cannot write the recording"):
        write_recording(small_recording(), tmp_path / "absent" / "r.h5")


@pytest.mark.parametrize("kept", [0, 7, 3000, 297_000])
def test_a_truncated_file_is_one_line(tmp_path, kept):
    path = tmp_path / "cut.h5"
    path.write_bytes((DATA / "null-1.h5").read_bytes()[:kept])
    with pytest.raises(UnusableInput, match=r"cut\.h5: not a readable HDF5 file") as failure:
        read_recording(path)
    assert "\n" not in str(failure.value)
