"""Simulated stages with known effects, for what finds them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.plant import simulate
from hil_sim.settings import StageSettings
from sim2real.blind.reserved_effects import VARIANTS
from sim2real.fitting import NUISANCES, AxisModel, AxisProblem, Term
from sim2real.gap import prepare_replay
from sim2real.tracking import Tracker
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.settings.package_settings import stage_settings
from stagectl.store import read_recording
from stagedata import Recording

DATA = Path(__file__).parents[2] / "data"
TOLERANCE = {"x": 0.003, "y": 0.003}
Nominal = tuple[Recording, StageSettings]
"""A recording without effects, and the stage that made it."""
SECONDS = 3.0
FINER = 8
"""Plant steps per control tick of these stages, of which the diagnosis knows nothing."""


@pytest.fixture(scope="session")
def stage() -> StageSettings:
    """The packaged stage."""
    return stage_settings(load_machine())


@pytest.fixture(scope="session")
def recorded() -> Recording:
    """A recording of it."""
    return read_recording(DATA / "null-2.h5")


@pytest.fixture(scope="session")
def nominal() -> Nominal:
    recording = read_recording(DATA / "null-1.h5")
    return recording, stage_settings(parse_machine(recording.machine, "null-1"))


def stage_with(
    nominal: Nominal,
    seed: int,
    seconds: float = SECONDS,
    **effects: dict[str, dict[str, float]],
) -> Recording:
    """A recording of a stage with effects (axis -> effect -> values), finer steps, other plant."""
    recording, settings = nominal
    count = min(round(seconds / settings.sync_period), len(recording))
    rng = np.random.default_rng(seed)
    known = {e.name: e for e in VARIANTS} | dict(library())
    axes = []
    for axis in settings.axes:
        terms = tuple(
            Term(known[name], tuple(values.values()))
            for name, values in effects.get(axis.name, {}).items()
        )
        axes.append(
            AxisModel(TOLERANCE[axis.name] * rng.standard_normal(NUISANCES), terms).settings(axis)
        )
    replay = prepare_replay(recording, settings)
    run = simulate(
        replace(settings, axes=tuple(axes)), replay.demand[:count], replay.offset[:count], seed,
        substeps=FINER,
    )  # fmt: skip
    signals = {
        name: replace(
            of,
            position_demand=of.position_demand[:count],
            force_offset=of.force_offset[:count],
            position_actual=run.position[:, a],
            force_actual=run.force[:, a],
            statusword=None,
            valid=of.valid[:count],
        )
        for a, (name, of) in enumerate(recording.axes.items())
    }
    moves = tuple(m for m in recording.moves if m.end < count)
    return replace(
        recording, time=recording.time[:count], axes=signals, moves=moves, source=f"seed {seed}"
    )


def problem_of(recording: Recording, settings: StageSettings, axis: str = "x") -> AxisProblem:
    """One axis of a recording, tracked."""
    return AxisProblem([Tracker(prepare_replay(recording, settings), settings, axis)], 0.003)
