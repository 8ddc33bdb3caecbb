"""Faults files: the faults they become, and refused values with their place."""

import math
from pathlib import Path

import pytest

from hil_sim.bus import faults as f
from stagectl.config.fault_plan import load_faults, parse_faults

EXAMPLE = Path(__file__).parents[4] / "examples" / "faults.yaml"


def test_the_example_of_the_documentation(machine):
    plan = load_faults(EXAMPLE, machine, 3)
    assert plan.seed == 7
    assert [type(x) for x in plan.faults] == [f.Drop, f.Delay, f.Duplicate, f.DriveFault]


def test_the_seed_of_the_run_is_used_unless_the_file_has_one(machine):
    text = "faults: [{fault: reboot, axis: x, at: 1 s}]"
    assert parse_faults(text, "faults.yaml", machine, 11).seed == 11


def ids(fault):
    return set(fault.frames.ids), fault.frames.sender, fault.frames.node


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        ("sync", ({0x080}, "host", None)),
        ("nmt", ({0x000}, "host", None)),
        ("host_heartbeat", ({0x77F}, "host", None)),
        ("rpdo1", ({0x201, 0x202}, "host", None)),
        ("rpdo1, axis: y", ({0x202}, "host", None)),
        ("sdo_request, axis: x", ({0x601}, "host", None)),
        ("sdo_answer, axis: x", ({0x581}, "drives", None)),
        ("tpdo1, axis: y", ({0x182}, "drives", None)),
        ("tpdo2", ({0x281, 0x282}, "drives", None)),
        ("emcy, axis: x", ({0x081}, "drives", None)),
        ("heartbeat", ({0x701, 0x702}, "drives", None)),
        ("sync, axis: y", ({0x080}, "host", 2)),
        ("'0x5A1'", ({0x5A1}, None, None)),
    ],
)
def test_frames_by_name(parse, frame, expected):
    (fault,) = parse(f"fault: drop, frame: {frame}")
    assert ids(fault) == expected


def test_any_frames(parse):
    host, drives, every = parse(
        "fault: drop, frame: from_host, axis: x",
        "fault: drop, frame: from_drives, axis: y",
        "fault: drop, frame: any",
    )
    assert (host.frames.ids, host.frames.sender, host.frames.node) == (None, "host", 1)
    assert (drives.frames.ids, drives.frames.sender, drives.frames.node) == (None, "drives", 2)
    assert (every.frames.ids, every.frames.sender) == (None, None)


def test_every_kind(parse):
    window = (
        "frame: tpdo1, axis: x, after: 1 s, until: 2, nth: [2, 3], probability: 0.5, at_most: 4"
    )
    x = f.Frames(frozenset({0x181}), "drives", None, 1.0, 2.0, frozenset({2, 3}), 0.5, 4)
    sync = f.Frames(frozenset({0x80}), "host")
    cases = {
        f"fault: drop, {window}": f.Drop(x),
        f"fault: duplicate, copies: 2, {window}": f.Duplicate(x, 2),
        f"fault: delay, least: 10 us, most: 1 ms, {window}": f.Delay(x, 1e-5, 1e-3),
        f"fault: reorder, hold: 2 ms, {window}": f.Reorder(x, 2e-3),
        f"fault: resize, length: 3, {window}": f.Resize(x, 3),
        f"fault: freeze, {window}": f.Freeze(x),
        "fault: sync_jitter, most: 20 us": f.Delay(sync, 0.0, 2e-5),
        "fault: sync_miss, nth: 5": f.Drop(
            f.Frames(frozenset({0x80}), "host", nth=frozenset({5}))
        ),
        "fault: heartbeat_silence, of: host, after: 3": f.Drop(
            f.Frames(frozenset({0x77F}), after=3.0)
        ),
        "fault: drive, axis: y, error: under_voltage, at: 1, until: 2": f.DriveFault(
            2, 0x3220, at=1.0, until=2.0
        ),
        "fault: heartbeat_silence, of: y, after: 3, until: 4": f.Drop(
            f.Frames(frozenset({0x702}), after=3.0, until=4.0)
        ),
        "fault: bus_off, of: x, at: 3, duration: 20 ms": f.BusOff(1, 3.0, 0.02),
        "fault: bus_off, of: host, at: 3, duration: 20 ms": f.BusOff(None, 3.0, 0.02),
        "fault: reboot, axis: y, at: 3": f.Reboot(2, 3.0),
        "fault: sdo_abort, axis: x, nth: 4, times: 2, code: '0x06040043', object: '0x6060'":
            f.SdoAbort(1, 4, 2, 0x06040043, 0x6060),
        "fault: drive, axis: x, error: encoder_loss, at: 3": f.DriveFault(1, 0x7305, at=3.0),
        "fault: drive, axis: y, error: over_travel, position: -10 mm": f.DriveFault(
            2, 0x8612, position=-0.01
        ),
    }  # fmt: skip
    assert parse(*cases) == tuple(cases.values())


def test_a_fault_without_an_end_lasts_forever(parse):
    (fault,) = parse("fault: drop, frame: sync, after: 2 s")
    assert fault.frames.until == math.inf
