"""The moves to record next: short sequences on which two models of an axis differ most.

Two models that the recordings leave open are run, noise-free and in closed loop, through a
handful of sequences that excite different things. The one on which they differ most, in floors,
is proposed as moves of a recipe. Range, speed and acceleration are those of the recordings, so
that the machine can execute them. Moves are repeated until their recording is long enough to be
diagnosed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hil_sim.plant import simulate
from hil_sim.settings import StageSettings
from sim2real.experiment.sequences import (
    MICRO_LIMITS,
    Reach,
    candidate_sequences,
    repeat_moves,
    round_up,
    setpoints,
)
from sim2real.findings import SHORTEST, NextExperiment
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import Measured
from stagedata import F64

_JERK = 100.0
"""Jerk of the macro-moves [m/s^3]."""


def propose_experiment(
    why: str,
    one: Mapping[str, AxisModel],
    other: Mapping[str, AxisModel],
    axis: str,
    measured: Sequence[Measured],
    settings: StageSettings,
) -> NextExperiment | None:
    """The sequence on which two models differ most; None where none differs by more than a floor.

    Args:
        why: what is open, the beginning of a sentence.
        one: axis -> model.
        other: likewise.
        axis: that the question is about.
        measured: recordings, with their floors.
        settings: of the machine file.
    """
    reach = {a.name: _reach(measured, a.name) for a in settings.axes}
    stages = [compose_stage(settings, models) for models in (one, other)]
    before = _difference(measured[0].replay.demand, measured[0].replay.offset, stages, measured)
    macro = {
        "velocity": min(r.speed for r in reach.values()),
        "acceleration": min(r.acceleration for r in reach.values()),
        "jerk": _JERK,
    }
    best, most, said = None, 1.0, ""
    for name, once in candidate_sequences(settings, axis, reach):
        moves = repeat_moves(once, settings, macro, SHORTEST)
        demand = setpoints(moves, settings, macro)
        acceleration = np.zeros_like(demand)
        acceleration[1:-1] = np.diff(demand, 2, axis=0) / settings.sync_period**2
        offset = acceleration * np.array([a.mass for a in settings.axes])
        apart = _difference(demand, offset, stages, measured)
        if apart > most:
            best, most, said = moves, apart, name
    if best is None:
        return None
    return NextExperiment(
        f"{why}: the two differ by {before:.2g} floors in these recordings, and by {most:.2g} in "
        f"{said}",
        tuple(best),
        macro,
        MICRO_LIMITS,
    )


def _difference(
    demand: F64, offset: F64, stages: Sequence[StageSettings], measured: Sequence[Measured]
) -> float:
    """Root mean square difference of two stages' signals over their floors."""
    one, other = (
        simulate(stage, demand, offset, None, substeps=stage.quick_substeps) for stage in stages
    )
    total = []
    for a, axis in enumerate(stages[0].axes):
        for signal in ("position", "force"):
            apart = getattr(one, signal)[:, a] - getattr(other, signal)[:, a]
            floor = max(measured[0].floor.rms[axis.name][signal], 1e-12)
            total.append(float(np.mean(np.square(np.nan_to_num(apart, nan=1.0)))) / floor**2)
    return float(np.sqrt(np.mean(total)))


def _reach(measured: Sequence[Measured], axis: str) -> Reach:
    """Range, speed and acceleration of an axis in the recordings."""
    low, high, speed, acceleration = np.inf, -np.inf, 0.0, 0.0
    for m in measured:
        demand = m.replay.demand[:, m.replay.names.index(axis)]
        velocity = np.diff(demand) / m.replay.period
        low, high = min(low, float(demand.min())), max(high, float(demand.max()))
        speed = max(speed, float(np.abs(velocity).max()))
        # Over ten periods, as setpoints are rounded.
        steep = np.abs(velocity[10:] - velocity[:-10]) / (10 * m.replay.period)
        acceleration = max(acceleration, float(steep.max()) if len(steep) else 0.0)
    # Slightly inside, as setpoints are rounded.
    return Reach(
        round_up(low), -round_up(-high), -round_up(-speed), -round_up(-0.99 * acceleration)
    )
