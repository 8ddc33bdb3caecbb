"""The course of one axis in all recordings: its motion, and forces measured and simulated.

The motion is the demanded one, which has no noise. Where only forces are compared, along the
measured motion, the smoothed measured motion takes its place, and there is no frequency response.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim2real.gap import Measured, Signals
from sim2real.phases import REST, SETTLING, Stroke, split_phases
from stagedata import BoolArray, FloatArray, aligned_demand

MEASURED = "measured"
BEFORE, AFTER = "before", "after"
"""Models: the machine file as given, and with the causes found."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """One axis, all recordings one after the other, K samples.

    Attributes:
        axis: its name.
        period: of the samples [s].
        starts: first sample of each recording.
        demand: demanded position when sampled, float64[K] [m]; None where only forces are compared.
        position, velocity: of the motion, float64[K] [m, m/s].
        moving, valid: bool[K].
        strokes: motions in one direction, in order of time.
        measured: "position", "force" -> float64[K] [m, N].
        simulated: model -> as `measured`; `BEFORE`, and `AFTER` where causes were found.
    """

    axis: str
    period: float
    starts: tuple[int, ...]
    demand: FloatArray | None
    position: FloatArray
    velocity: FloatArray
    moving: BoolArray
    valid: BoolArray
    strokes: tuple[Stroke, ...]
    measured: Mapping[str, FloatArray]
    simulated: Mapping[str, Mapping[str, FloatArray]]

    def residual(self, model: str) -> FloatArray:
        """Measured minus simulated force, float64[K] [N]."""
        return self.measured["force"] - self.simulated[model]["force"]


def gather_course(
    measured: Sequence[Measured],
    explained: Sequence[Signals] | None,
    axis: str,
    ratio: float,
) -> Course:
    """The course of an axis in all recordings.

    Args:
        measured: gap of each recording.
        explained: signals of the model with the causes, per recording; None without causes.
        axis: its name.
        ratio: Tc/Ts, control period over SYNC period.
    """
    recorded = [m.replay.recording.axes[axis] for m in measured]
    phases = [
        split_phases(signals.position_demand, m.replay.period)
        for m, signals in zip(measured, recorded, strict=True)
    ]
    phase = np.concatenate([p.phase for p in phases])
    starts = tuple(int(n) for n in np.cumsum([0, *(len(s) for s in recorded)])[:-1])
    strokes = tuple(
        Stroke(start + s.start, start + s.end, s.direction, s.length)
        for start, own in zip(starts, phases, strict=True)
        for s in own.strokes
    )
    position = np.concatenate([aligned_demand(signals, ratio) for signals in recorded])
    is_closed_loop = all("position" in m.gap[axis] for m in measured)
    models = {BEFORE: [m.floor.nominal[axis] for m in measured]}
    if explained is not None:
        models[AFTER] = [signals[axis] for signals in explained]
    return Course(
        axis=axis,
        period=measured[0].replay.period,
        starts=starts,
        demand=position if is_closed_loop else None,
        position=position,
        velocity=np.concatenate([p.velocity for p in phases]),
        moving=(phase != REST) & (phase != SETTLING),
        valid=np.concatenate([signals.valid for signals in recorded]),
        strokes=strokes,
        measured=_joined([m.replay.measured()[axis] for m in measured]),
        simulated={model: _joined(parts) for model, parts in models.items()},
    )


def _joined(parts: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
    return {signal: np.concatenate([p[signal] for p in parts]) for signal in parts[0]}
