"""The models of a faults file: kinds, keys, values that are refused, and their page."""

import re
from pathlib import Path
from typing import get_args

import pytest

from hil_sim.bus import faults as f
from stagectl.config import faults
from stagectl.config.faults import FRAME_NAMES
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
        (
            "fault: drive, axis: x, error: hardware, at: 2, until: 1",
            "2:60",
            "must be later than at",
        ),
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


PAGE = (Path(__file__).parents[4] / "docs" / "faults.md").read_text(encoding="utf-8")


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
