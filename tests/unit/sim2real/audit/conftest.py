"""Recordings with one channel spoilt, and the single finding that an audit makes of one."""

from dataclasses import replace

import pytest

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
def recorded(recorded):
    return first(recorded)


def spoilt(recorded, **channels):
    """The x axis with channels replaced by functions of what they were."""
    x = recorded.axes["x"]
    changed = {name: spoil(getattr(x, name)) for name, spoil in channels.items()}
    return replace(recorded, axes={**recorded.axes, "x": replace(x, **changed)})


def single(found):
    (finding,) = found.findings
    return (finding.axis, finding.channel, finding.finding), finding
