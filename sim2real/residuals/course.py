"""The course of one axis in all recordings: its motion, and forces measured and simulated.

The motion is the demanded one, which has no noise; where none was recorded, the measured one,
smoothed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sim2real.gap import Measured, Signals
from sim2real.phases import REST, SETTLING, Stroke, split_phases
from stagedata import AxisSignals, BoolArray, FloatArray, aligned_demand

BEFORE, AFTER = "before", "after"
"""Models: the machine file as given, and with the causes found."""

_SMOOTHING = 0.01
"""Time over which a measured motion is averaged [s]."""
_STANDING = 0.005
"""Share of the highest speed below which a measured motion counts as standstill."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """One axis, all recordings one after the other, K samples.

    Attributes:
        axis: its name.
        period: of the samples [s].
        starts: first sample of each recording.
        demand: demanded position when sampled, float64[K] [m]; None where it was not recorded.
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


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """Position, velocity, whether it moves, and strokes, of one recording."""

    position: FloatArray
    velocity: FloatArray
    moving: BoolArray
    strokes: tuple[Stroke, ...]


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
    demands = [_demand(signals, ratio) for signals in recorded]
    motions = [
        _demanded_motion(signals.position_demand, demand, m.replay.period)
        if demand is not None
        else _measured_motion(signals, m.replay.period)
        for m, signals, demand in zip(measured, recorded, demands, strict=True)
    ]
    starts = tuple(int(n) for n in np.cumsum([0, *(len(s) for s in recorded)])[:-1])
    strokes = tuple(
        Stroke(start + s.start, start + s.end, s.direction, s.length)
        for start, motion in zip(starts, motions, strict=True)
        for s in motion.strokes
    )
    models = {BEFORE: [m.floor.nominal[axis] for m in measured]}
    if explained is not None:
        models[AFTER] = [signals[axis] for signals in explained]
    known = [demand for demand in demands if demand is not None]
    return Course(
        axis=axis,
        period=measured[0].replay.period,
        starts=starts,
        demand=np.concatenate(known) if len(known) == len(demands) else None,
        position=np.concatenate([m.position for m in motions]),
        velocity=np.concatenate([m.velocity for m in motions]),
        moving=np.concatenate([m.moving for m in motions]),
        valid=np.concatenate([signals.valid for signals in recorded]),
        strokes=strokes,
        measured=_joined([m.replay.measured()[axis] for m in measured]),
        simulated={model: _joined(parts) for model, parts in models.items()},
    )


def _joined(parts: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
    return {signal: np.concatenate([p[signal] for p in parts]) for signal in parts[0]}


def _demand(signals: AxisSignals, ratio: float) -> FloatArray | None:
    """Demanded position at the instants of the samples [m]; None where there is none."""
    if "position_demand" in signals.missing:
        return None
    return aligned_demand(signals, ratio)


def _demanded_motion(setpoints: FloatArray, demand: FloatArray, period: float) -> _Motion:
    phases = split_phases(setpoints, period)
    moving = (phases.phase != REST) & (phases.phase != SETTLING)
    return _Motion(demand, phases.velocity, moving, phases.strokes)


def _measured_motion(signals: AxisSignals, period: float) -> _Motion:
    """The motion as measured, where no demand was recorded."""
    width = 2 * max(1, round(_SMOOTHING / period / 2)) + 1
    mean = np.ones(width) / width

    def smoothed(values: FloatArray) -> FloatArray:
        return np.convolve(np.pad(values, width // 2, mode="edge"), mean, mode="valid")

    position = smoothed(signals.position_actual)
    velocity = smoothed(np.gradient(position, period))
    sign = np.where(np.abs(velocity) > _STANDING * np.abs(velocity).max(), np.sign(velocity), 0.0)
    edges = [0, *(np.flatnonzero(np.diff(sign)) + 1).tolist(), len(sign)]
    strokes = tuple(
        Stroke(first, end, int(sign[first]), abs(float(position[end - 1] - position[first])))
        for first, end in pairwise(edges)
        if sign[first]
    )
    return _Motion(position, velocity, sign != 0.0, strokes)
