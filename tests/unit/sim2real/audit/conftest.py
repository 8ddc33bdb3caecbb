"""Recordings with one channel spoilt, and the single finding that an audit makes of one."""

from dataclasses import replace
from pathlib import Path

import pytest

from stagectl.config import load_machine, stage_settings
from stagectl.store import read_recording

DATA = Path(__file__).parents[3] / "data"
SAMPLES = 1000


def first(recorded, samples=SAMPLES):
    axes = {
        name: replace(
            signals,
            **{
                channel: getattr(signals, channel)[:samples]
                for channel in (
                    "position_demand", "force_offset", "position_actual", "force_actual",
                    "statusword", "valid",
                )
            },
        )
        for name, signals in recorded.axes.items()
    }  # fmt: skip
    moves = tuple(m for m in recorded.moves if m.end <= samples)
    return replace(recorded, time=recorded.time[:samples], axes=axes, moves=moves)


@pytest.fixture(scope="module")
def stage():
    return stage_settings(load_machine())


@pytest.fixture(scope="module")
def recorded():
    return first(read_recording(DATA / "null-2.h5"))


def spoilt(recorded, **channels):
    """The x axis with channels replaced by functions of what they were."""
    x = recorded.axes["x"]
    changed = {name: spoil(getattr(x, name)) for name, spoil in channels.items()}
    return replace(recorded, axes={**recorded.axes, "x": replace(x, **changed)})


def single(found):
    (finding,) = found.findings
    return (finding.axis, finding.channel, finding.finding), finding
