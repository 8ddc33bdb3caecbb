"""Recordings on disk: round trip, other programs' files, and every way to be unusable."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from stagectl.errors import StagectlError, UnusableInput
from stagectl.store import read_recording, write_recording
from tests.unit.stagectl.store.recordings import small_recording

DATA = Path(__file__).parents[3] / "data"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "recording.h5"
    write_recording(small_recording(), path)
    return path


def test_round_trip_keeps_every_sample_the_moves_and_the_order_of_axes(path: Path):
    made, read = small_recording(), read_recording(path)
    assert (read.machine, read.recipe, read.started) == (made.machine, "", made.started)
    assert read.moves == made.moves
    assert list(read.axes) == ["y", "x"]
    np.testing.assert_array_equal(read.time, made.time)
    for name, signals in made.axes.items():
        for field in signals.__slots__:
            np.testing.assert_array_equal(getattr(read.axes[name], field), getattr(signals, field))


def test_every_dataset_has_a_unit_and_no_part_file_remains(path: Path):
    lacking: list[str] = []
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
def test_recordings_of_another_program_can_be_read(name: str):
    recording = read_recording(DATA / f"{name}.h5")
    assert list(recording.axes) == ["x", "y"]
    assert len(recording.moves) == 38
    assert recording.moves[0].site is None
    assert recording.axes["x"].valid.all()  # absent means all valid
    assert recording.machine.startswith("# The reference stage")


def test_unknown_groups_and_attributes_are_ignored(path: Path):
    with h5py.File(path, "a") as file:
        file.attrs["colour"] = "blue"
        file["axes/x/temperature"] = np.zeros(3)
        file.create_group("vendor/deep")
    assert len(read_recording(path)) == 50


def replace(path: Path, name: str, values: object) -> None:
    with h5py.File(path, "a") as file:
        if name in file:
            del file[name]
        if values is not None:
            file[name] = values


def moves_with(column: str, value: object, kind: str = "S8") -> np.ndarray:
    row = {"kind": b"macro", "start": 1, "end": 9, "from_x": 0.0, "from_y": 0.0}
    row |= {"to_x": 0.0, "to_y": 0.0, column: value}
    kinds = [(k, kind if k == "kind" else "i8" if k in ("start", "end") else "f8") for k in row]
    return np.array([tuple(row.values())], dtype=kinds)


@pytest.mark.parametrize(
    ("dataset", "values", "message"),
    [
        ("time", None, "/time: missing"),
        ("time", np.zeros(50), "/time: sample 1: not later"),
        ("moves", None, "/moves: missing"),
        ("moves", np.zeros(3), "/moves: holds float64"),
        ("moves", moves_with("kind", b"jump"), "/moves: row 0: kind 'jump'"),
        ("moves", moves_with("kind", 1, "i8"), "/moves: row 0: kind ''"),
        ("moves", moves_with("end", 51), "/moves: row 0: samples 1..51"),
        ("moves", moves_with("to_y", np.inf), "/moves: row 0: a non-finite position"),
        ("axes", None, "/axes: missing"),
        ("axes/y", np.zeros(50), "/axes/y: must be a group"),
        ("axes/y/position_actual", None, "/axes/y/position_actual: missing"),
        ("axes/y/position_actual", np.zeros(49), "/axes/y/position_actual: 49 samples, /time"),
        ("axes/y/force_actual", np.where(np.arange(50) == 7, np.nan, 0), "sample 7: is nan"),
        ("axes/y/valid", np.zeros(50), "/axes/y/valid: holds float64"),
    ],
)
def test_an_unusable_recording_is_one_line_naming_file_and_dataset(
    path: Path, dataset: str, values: object, message: str
):
    replace(path, dataset, values)
    with pytest.raises(UnusableInput) as failure:
        read_recording(path)
    text = str(failure.value)
    assert text.startswith(f"{path}: ")
    assert message in text
    assert "\n" not in text


def test_samples_in_another_unit_are_refused(path: Path):
    with h5py.File(path, "a") as file:
        file["axes/y/position_actual"].attrs["unit"] = "mm"
    with pytest.raises(UnusableInput, match=r"/axes/y/position_actual: attribute unit is 'mm'"):
        read_recording(path)


@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("format", "something-else", "attribute format"),
        ("version", 2, "version: 2 is newer"),
        ("version", "1", "attribute version: must be a whole number"),
        ("machine", 5, "attribute machine: must be text"),
        ("machine", b"\xff\xfe", "attribute machine: not UTF-8"),
        ("version", "1\n2", "version"),
        ("started", "2026\x1b[31m", "started"),
        ("format", "a\nb", "format"),
    ],
)
def test_another_format_or_a_newer_version_is_refused(
    path: Path, attribute: str, value: object, message: str
):
    with h5py.File(path, "a") as file:
        file.attrs[attribute] = value
    with pytest.raises(UnusableInput, match=message) as caught:
        read_recording(path)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("kept", [0, 7, 100, 3000, 100_000, 297_000])
def test_a_truncated_file_is_one_line(tmp_path: Path, kept: int):
    path = tmp_path / "cut.h5"
    path.write_bytes((DATA / "null-1.h5").read_bytes()[:kept])
    with pytest.raises(UnusableInput, match=r"cut\.h5: not a readable HDF5 file") as failure:
        read_recording(path)
    assert "\n" not in str(failure.value)


def test_damaged_bytes_are_one_line(tmp_path: Path):
    whole = bytearray((DATA / "null-2.h5").read_bytes())
    rng = np.random.default_rng(3)
    path = tmp_path / "damaged.h5"
    messages: list[str] = []
    for _ in range(60):
        damaged = whole.copy()
        # Mostly in the first kilobytes, where the structure is.
        for at in rng.integers(0, rng.choice([4000, len(whole)]), 20):
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_recording(path)
        except UnusableInput as error:
            messages.append(str(error))
    assert len(messages) > 5
    assert not any("\n" in message for message in messages)


def test_a_missing_file_and_a_folder_are_one_line(tmp_path: Path):
    with pytest.raises(UnusableInput, match="no such file"):
        read_recording(tmp_path / "absent.h5")
    with pytest.raises(UnusableInput, match="is not a file"):
        read_recording(tmp_path)


def test_a_failed_write_is_one_line(tmp_path: Path):
    with pytest.raises(StagectlError, match="cannot write the recording"):
        write_recording(small_recording(), tmp_path / "absent" / "r.h5")


def test_the_name_of_an_axis_has_no_control_character(path):
    with h5py.File(path, "a") as file:
        file.move("axes/x", "axes/x\x1b")
    with pytest.raises(UnusableInput, match="the control character U\\+001B") as caught:
        read_recording(path)
    assert str(caught.value).isprintable()
