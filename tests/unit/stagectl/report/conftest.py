"""A recording by another program, and a summary of it as if it were a run."""

from dataclasses import replace
from pathlib import Path

import pytest

from stagectl.store import read_recording, summarise_samples

TC, TS = 1e-4, 1e-3


def friction(site, axis, value, reason=None):
    return {
        "site": site, "axis": axis, "accepted": reason is None, "reason": reason,
        "compute_time": 3e-5, "gain": {}, "held": [],
        "parameters": {"coulomb": {"value": value, "sigma": 0.01, "unit": "N"}},
    }  # fmt: skip


FACTS = {
    "recipe": "inspection", "machine": "wafer-xy", "compensation": "estimated", "seed": 1,
    "simulated": True, "lot": None, "duration": 9.7, "wall_time": 0.6, "outcome": "completed",
    "fault": None,
    "friction": [friction(1, "x", 6.02), friction(2, "y", 99.0, "innovation <too> large")],
}  # fmt: skip


@pytest.fixture(scope="session")
def recording():
    """Another program's recording, with sites as a run of ours would have them."""
    read = read_recording(Path(__file__).parents[3] / "data" / "null-1-other-moves.h5")
    moves = tuple(replace(move, site=i // 2 + 1) for i, move in enumerate(read.moves))
    return replace(read, moves=moves)


def summary_of(recording, **changes):
    return {**FACTS, **summarise_samples(recording, TC, TS), **changes}


@pytest.fixture(scope="session")
def summary(recording):
    return summary_of(recording)
