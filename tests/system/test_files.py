"""The files of a run, read with the tools that others use."""

import json

import can
import h5py
import numpy as np
import pytest

from stagectl.store import read_recording


def test_recording_has_what_the_format_asks_for(typical, machine):
    _, folder = typical
    with h5py.File(folder / "recording.h5") as file:
        assert file.attrs["format"] == "stagectl-recording"
        assert file.attrs["version"] == 1
        assert file.attrs["machine"] == machine.text
        assert "recipe: inspection-20" in file.attrs["recipe"]
        count = len(file["time"])
        np.testing.assert_allclose(np.diff(file["time"][:]), 1e-3, atol=1e-9)
        for axis in ("x", "y"):
            for name in (
                "position_demand", "force_offset", "position_actual", "force_actual",
                "statusword", "valid",
            ):  # fmt: skip
                dataset = file[f"axes/{axis}/{name}"]
                assert dataset.shape == (count,)
                assert "unit" in dataset.attrs
            assert file[f"axes/{axis}/valid"][:].all()
        moves = file["moves"][:]
        assert set(moves.dtype.names) == {
            "kind", "site", "start", "end", "from_x", "from_y", "to_x", "to_y",
        }  # fmt: skip
        assert [m.decode() for m in moves["kind"]] == ["macro", "micro"] * 20
        assert moves["site"].tolist() == [s for s in range(1, 21) for _ in range(2)]


def test_summary_is_what_is_printed(typical):
    result, folder = typical
    written = json.loads((folder / "summary.json").read_text())
    assert written == json.loads(json.dumps(result.summary))
    assert (written["format"], written["version"]) == ("stagectl-run-summary", 1)
    assert written["micro"]["count"] == 40
    assert written["cycle"] == {"period": 0.001, "missed": 0, "late": 0}
    assert written["duration"] == pytest.approx(len(result.recording) * 1e-3)


def test_bus_log_is_read_by_can_tools(typical):
    result, folder = typical
    with can.LogReader(folder / "bus.asc") as log:
        frames = list(log)
    sync = [f for f in frames if f.arbitration_id == 0x80]
    assert len(sync) >= len(result.recording)
    ids = {f.arbitration_id for f in frames}
    assert {0x000, 0x080, 0x181, 0x182, 0x201, 0x202, 0x601, 0x581, 0x701, 0x702} <= ids
    # No SDO between the first and the last streamed SYNC but before and after.
    streamed = [f.timestamp for f in frames if f.arbitration_id == 0x201]
    busy = [f for f in frames if f.arbitration_id in (0x601, 0x602)]
    inside = [f for f in busy if streamed[-len(result.recording)] < f.timestamp < streamed[-1]]
    assert inside == []


def test_report_is_one_file_that_opens_offline(typical):
    text = (typical[1] / "report.html").read_text()
    assert "inspection-20" in text
    for outside in ("<link", 'src="http', "src='http", "@import", "url(http"):
        assert outside not in text


def test_its_own_recording_has_no_gap_worth_the_name(typical, machine):
    from sim2real.gap import measure_gap
    from stagectl.config import stage_settings

    recording = read_recording(typical[1] / "recording.h5")
    for signals in measure_gap(recording, stage_settings(machine), draws=1).values():
        # After homing the first onset is not known exactly.
        assert signals["position"].nominal < 0.5e-6
        assert signals["force"].nominal < 0.5
