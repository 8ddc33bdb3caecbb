"""Faults files: the faults they become, values that are refused with their place, their page."""

import math
import re
from pathlib import Path
from typing import get_args

import pytest

from hil_sim.bus import faults as f
from stagectl.config import faults
from stagectl.config.faults import FRAME_NAMES, load_faults, parse_faults
from stagectl.config.parsing.validation import Section
from stagectl.errors import ConfigError


@pytest.mark.parametrize(
    ("line", "place", "word"),
    [
        ("fault: dropp, frame: sync", "2:13", "must be one of drop"),
        ("fault: drop, frame: tpdo9", "2:26", "did you mean 'tpdo"),
        ("fault: drop", "2:5", "frame: is missing"),
        ("fault: drop, frame: sync, probabilty: 0.1", "2:32", "did you mean 'probability'"),
        ("fault: drop, frame: sync, at: 2 s", "2:32", "unknown key; known: after, until, nth,"),
        ("fault: reboot, axis: x, at: 1, frame: sync", "2:37", "known: fault, axis, at"),
        ("fault: drop, frame: sync, probability: 1.5", "2:45", "must be <= 1"),
        ("fault: drop, frame: sync, nth: 0", "2:37", "must be >= 1"),
        ("fault: drop, frame: tpdo1, axis: z", "2:39", "no such axis"),
        ("fault: drop, frame: '0x181', axis: x", "2:41", "known sender"),
        ("fault: drop, frame: sync, after: 2 s, until: 1 s", "2:51", "later than after"),
        ("fault: drop, frame: sync, after: 2 m", "2:39", "a time"),
        ("fault: delay, frame: sync, least: 2 ms, most: 1 ms", "2:40", "more than most"),
        ("fault: resize, frame: sync, length: 9", "2:42", "must be <= 8"),
        ("fault: drive, axis: x, error: bang, at: 1", "2:36", "over_current"),
        ("fault: drive, axis: x, error: over_current", "2:5", "either at or position"),
        ("fault: drive, axis: x, error: hardware, at: 2, until: 1", "2:60", "later than at"),
        ("fault: bus_off, of: hosts, at: 1, duration: 1", "2:26", "did you mean 'host'"),
        ("fault: sto, axis: x, at: 1.0e+300", "2:31", "must be <= 1e+09"),
        ("fault: sdo_abort, axis: x, code: 1234", "2:39", "'0x08000000'"),
    ],
)
def test_refused_values_are_reported_with_their_place(parse, line, place, word):
    with pytest.raises(ConfigError) as caught:
        parse(line)
    (problem,) = caught.value.problems
    assert problem.startswith(f"faults.yaml:{place}: faults[1]")
    assert word in problem


PAGE = (Path(__file__).parents[4] / "docs" / "how-to" / "faults.md").read_text(encoding="utf-8")


def table_after(heading):
    """First cell of each row, without backticks -> the other cells."""
    table = PAGE.partition(heading)[2].partition("\n\n|")[2].partition("\n\n")[0]
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    return {first.strip("`"): others for first, *others in rows}


def names_in(text):
    return set(re.findall(r"`(\w+)`", text))


def test_the_page_has_exactly_the_faults_and_keys_of_the_file():
    documented = {
        kind: names_in(re.sub(r"\(.*?\)", "", keys))
        for heading in ("## Faults of frames", "## Faults of nodes")
        for kind, (keys, _) in table_after(heading).items()
    }
    accepted = {}
    for model in get_args(get_args(faults.FaultSection)[0]):
        common = next(
            (m for m in (faults.OnFrames, faults.Window) if issubclass(model, m)), Section
        )
        (kind,) = get_args(model.model_fields["fault"].annotation)
        accepted[kind] = set(model.model_fields) - set(common.model_fields) - {"fault"}
    assert documented == accepted
    selecting = set().union(*(first.split("`, `") for first in table_after("Selection of frames:")))
    assert selecting == set(faults.OnFrames.model_fields)


def test_the_page_has_exactly_the_frames_and_drive_faults_of_the_file():
    frames = names_in(table_after("Selection of frames:")["frame"][0])
    frames |= {f"{pdo}{n}" for pdo in ("rpdo", "tpdo") for n in (2, 3, 4)}  # "rpdo1 to 4"
    assert frames == set(FRAME_NAMES)
    _, effect = table_after("## Faults of nodes")["drive"]
    assert names_in(effect) - {"until"} == set(f.DRIVE_FAULTS)


EXAMPLE = Path(__file__).parents[4] / "examples" / "faults.yaml"


def test_the_example_of_the_documentation(machine):
    plan = load_faults(EXAMPLE, machine, 3)
    assert plan.seed == 7
    assert [type(x) for x in plan.faults] == [f.Drop, f.Delay, f.Duplicate, f.DriveFault]


def test_the_seed_of_the_run_is_used_unless_the_file_has_one(machine):
    text = "faults: [{fault: reboot, axis: x, at: 1 s}]"
    assert parse_faults(text, "faults.yaml", machine, 11).seed == 11


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
        ("from_host, axis: x", (None, "host", 1)),
        ("from_drives, axis: y", (None, "drives", 2)),
        ("any", (None, None, None)),
    ],
)
def test_frames_by_name(parse, frame, expected):
    (fault,) = parse(f"fault: drop, frame: {frame}")
    assert (fault.frames.ids, fault.frames.sender, fault.frames.node) == expected
    assert fault.frames.until == math.inf


def frames(*ids, sender=None, **limits):
    return f.Frames(frozenset(ids), sender, **limits)


def test_every_kind(parse):
    window = (
        "frame: tpdo1, axis: x, after: 1 s, until: 2, nth: [2, 3], probability: 0.5, at_most: 4"
    )
    x = f.Frames(frozenset({0x181}), "drives", None, 1.0, 2.0, frozenset({2, 3}), 0.5, 4)
    fifth = frames(0x80, sender="host", nth=frozenset({5}))
    cases = {
        f"fault: drop, {window}": f.Drop(x),
        f"fault: duplicate, copies: 2, {window}": f.Duplicate(x, 2),
        f"fault: delay, least: 10 us, most: 1 ms, {window}": f.Delay(x, 1e-5, 1e-3),
        f"fault: reorder, hold: 2 ms, {window}": f.Reorder(x, 2e-3),
        f"fault: resize, length: 3, {window}": f.Resize(x, 3),
        f"fault: freeze, {window}": f.Freeze(x),
        "fault: sync_jitter, most: 20 us": f.Delay(frames(0x80, sender="host"), 0.0, 2e-5),
        "fault: sync_miss, nth: 5": f.Drop(fifth),
        "fault: heartbeat_silence, of: host, after: 3": f.Drop(frames(0x77F, after=3.0)),
        "fault: heartbeat_silence, of: y, after: 3, until: 4":
            f.Drop(frames(0x702, after=3.0, until=4.0)),
        "fault: bus_off, of: x, at: 3, duration: 20 ms": f.BusOff(1, 3.0, 0.02),
        "fault: bus_off, of: host, at: 3, duration: 20 ms": f.BusOff(None, 3.0, 0.02),
        "fault: reboot, axis: y, at: 3": f.Reboot(2, 3.0),
        "fault: sdo_abort, axis: x, nth: 4, times: 2, code: '0x06040043', object: '0x6060'":
            f.SdoAbort(1, 4, 2, 0x06040043, 0x6060),
        "fault: drive, axis: x, error: encoder_loss, at: 3": f.DriveFault(1, 0x7305, at=3.0),
        "fault: drive, axis: y, error: under_voltage, at: 1, until: 2":
            f.DriveFault(2, 0x3220, at=1.0, until=2.0),
        "fault: drive, axis: y, error: over_travel, position: -10 mm":
            f.DriveFault(2, 0x8612, position=-0.01),
    }  # fmt: skip
    assert parse(*cases) == tuple(cases.values())
