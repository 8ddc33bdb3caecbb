"""Faults that may be acknowledged without anybody looking at the machine, and what follows."""

import numpy as np
import pytest

from drivers import AxisFault
from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from stagectl.run.retries import is_recoverable
from stagectl.store import read_recording
from tests.unit.stagectl.run.whole import FOLLOWING, OVER_CURRENT, failing_at


@pytest.mark.parametrize(
    ("code", "recoverable"),
    [
        (None, True),  # a drive that fell silent
        (0x8130, True),  # heartbeat lost
        (0x8611, True),  # following error
        (0x8612, False),  # over-travel
        (0x2310, False),  # current
        (0x3210, False),  # voltage
        (0x4210, False),  # temperature
        (0x5441, False),  # hardware
        (0x7300, False),  # sensor
    ],
)
def test_the_error_code_decides(code, recoverable):
    assert is_recoverable(AxisFault("fault", axis="x", code=code)) is recoverable


def test_a_site_is_begun_again_after_a_fault(go, sites, tmp_path):
    listener, stages = failing_at(6)
    result = go(sites, "run", listener=listener, retries=1)
    assert result.summary["outcome"] == "completed"
    assert [m.site for m in result.recording.moves] == [1, 1, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5]
    (retry,) = result.summary["retries"]
    assert (retry["site"], retry["attempt"]) == (3, 1)
    assert "0x8611" in retry["fault"]
    assert "site 3 restarted" in (tmp_path / "run" / "report.html").read_text()
    # the move that was broken off ends where its samples do
    broken, after = result.recording.moves[5], result.recording.moves[6]
    assert broken.end <= after.start
    entries = [m for m in result.summary["moves"] if m["site"] == 3 and m["kind"] == "micro"]
    assert [m.get("completed", True) for m in entries] == [False, False, True, True]
    # time goes on, with a gap where the fault was acknowledged
    gaps = np.diff(result.recording.time) > 1.5e-3
    assert gaps.sum() == 1
    assert broken.start < np.flatnonzero(gaps)[0] < after.start
    final = {e["axis"]: e for e in result.summary["friction"] if e["accepted"]}
    assert final["y"]["site"] == 5
    assert all(d.motion.state is State.SWITCH_ON_DISABLED for d in stages[0].drives)
    assert read_recording(tmp_path / "run" / "recording.h5").moves == result.recording.moves


def test_a_drive_that_reboots_is_homed_again_whatever_the_other_does_meanwhile(go, sites):
    faults = [f.Reboot(2, 3.2), f.DriveFault(1, FOLLOWING, at=4.2)]
    result = go(sites, "run", faults=faults, retries=2)
    assert result.summary["outcome"] == "completed"
    rebooted, on_the_way = result.summary["retries"]
    assert "axis y" in rebooted["fault"]
    assert "the drive rebooted" in rebooted["fault"]
    assert "axis x" in on_the_way["fault"]
    assert "0x8611" in on_the_way["fault"]
    assert rebooted["site"] == on_the_way["site"]
    assert result.summary["micro"]["count"] == 10


@pytest.mark.parametrize(
    ("code", "times", "retries", "made"),
    [(FOLLOWING, 9, 2, 2), (OVER_CURRENT, 1, 2, 0), (FOLLOWING, 1, 0, 0)],
    ids=["it comes every time", "somebody has to look first", "nobody asked for it"],
)
def test_when_a_fault_ends_the_run_all_the_same(go, sites, code, times, retries, made):
    listener, stages = failing_at(6, code, times)
    result = go(sites, "run", listener=listener, retries=retries)
    assert result.summary["outcome"] == "fault"
    assert f"0x{code:04X}" in result.summary["fault"]
    assert len(result.summary.get("retries", ())) == made
    assert all(d.motion.state is not State.ENABLED for d in stages[0].drives)
