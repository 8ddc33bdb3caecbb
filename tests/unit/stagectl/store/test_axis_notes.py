"""Kept by axis beside the machine file; a damaged file is named."""

import json

import pytest

from stagectl.errors import UnusableInput
from stagectl.store.axis_notes import AxisNotes


@pytest.fixture
def notes(tmp_path):
    (tmp_path / "m.yaml").touch()
    return AxisNotes(str(tmp_path / "m.yaml"), "seen")


def test_entries_are_kept_by_axis_beside_the_machine_file(notes, tmp_path):
    assert notes.read(dict) == {}
    notes.add({"x": {"at": 1}, "y": {"at": 2}})
    notes.add({"y": {"at": 3}})
    assert notes.read(lambda entry: entry["at"]) == {"x": 1, "y": 3}
    kept = json.loads((tmp_path / "m.seen.json").read_text())
    assert kept == {
        "format": "stagectl-seen",
        "version": 1,
        "axes": {"x": {"at": 1}, "y": {"at": 3}},
    }


@pytest.mark.parametrize(
    "text",
    ["", "[]", '{"format": "stagectl-seen", "version": 2, "axes": {}}',
     '{"format": "stagectl-seen", "version": 1, "axes": {"x": {}}}'],
)  # fmt: skip
def test_a_damaged_file_is_named(notes, text):
    notes.path.write_text(text)
    with pytest.raises(UnusableInput, match=r"m\.seen\.json: damaged"):
        notes.read(lambda entry: entry["at"])


def test_without_a_machine_file_nothing_is_kept(tmp_path):
    notes = AxisNotes(str(tmp_path / "packaged"), "seen")
    notes.add({"x": {}})
    assert (notes.path, notes.read(dict)) == (None, {})
    assert not list(tmp_path.iterdir())
