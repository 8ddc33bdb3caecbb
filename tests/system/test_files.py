"""Summary and bus log of a run, as others read them."""

import json

import can
import pytest


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
