"""A recording by another program, and a summary of it as if it were a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from stagectl.store import FrictionEntry, ParameterEstimate, RunFacts, build_summary, read_recording
from stagedata import Recording

TC, TS = 1e-4, 1e-3
FACTS = RunFacts("inspection", "wafer-xy", "estimated", 1, True, None, 9.7, 0.6, "completed")
FRICTION = [
    FrictionEntry(1, "x", True, None, 3e-5, {"coulomb": ParameterEstimate(6.02, 0.01, "N")}),
    FrictionEntry(
        2, "y", False, "innovation <too> large", 3e-5, {"coulomb": ParameterEstimate(99, 9, "N")}
    ),
]


@pytest.fixture(scope="session")
def facts() -> RunFacts:
    return FACTS


@pytest.fixture(scope="session")
def friction() -> list[FrictionEntry]:
    """An accepted estimate and a refused one."""
    return FRICTION


@pytest.fixture(scope="session")
def recording() -> Recording:
    """Another program's recording, with sites as a run of ours would have them."""
    read = read_recording(Path(__file__).parents[3] / "data" / "null-1-other-moves.h5")
    moves = tuple(replace(move, site=i // 2 + 1) for i, move in enumerate(read.moves))
    return replace(read, moves=moves)


@pytest.fixture(scope="session")
def summary(recording: Recording) -> dict[str, Any]:
    return build_summary(recording, FACTS, FRICTION, control_period=TC, sync_period=TS)
