"""The force that a model leaves in motion, and how much of it a course foretells.

Some effects come in any shape: friction over position, hysteresis over travel. Whether what is
left is of such a kind is told without a shape: by columns that only this kind has, fitted to all
strokes but two and held against these two. What changes with time, and what friction of a constant
level, viscous friction, drag, another mass, a spring, a constant force and the presliding of the
friction take up, does not count.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.fitting import AxisModel, composed
from sim2real.gap import Measured, residual

F64 = NDArray[np.float64]
Felt = Callable[[F64, F64, float], F64]
"""Columns float64[T, K] of positions float64[T] [m], demanded velocities float64[T] [m/s] and the
time between them [s]."""

_MOVING = 0.02
"""Demanded velocity from which friction has the sign of the velocity [m/s]."""
_FEWEST, _STROKES = 200, 8
"""Samples in motion and strokes that a verdict needs."""
_SILENT = 1e-3
"""Singular values below this share of the largest say nothing: places that were hardly passed."""
_PRESLIDING = (2e-5, 5e-5)
"""Travel after a reversal in which friction of another stiffness or level differs [m]."""
_LEVEL = 1
"""Neutral column that is a level of Coulomb friction."""


@dataclass(frozen=True, slots=True)
class Told:
    """What columns of one kind tell of the force left in motion.

    Attributes:
        share: of it that they foretell on strokes that they were not fitted to, 1 (all of it) or
            less; 0 or less: it is of another kind.
        level: Coulomb friction beside them [N].
        weights: of the columns, float64[K] [N].
        passed: samples that tell of each, float64[K].
    """

    share: float
    level: float
    weights: F64
    passed: F64


def told(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
    felt: Felt,
) -> Told:
    """Hold what a model leaves against columns of one kind.

    Args:
        name: of the axis.
        models: axis -> its model; axes that are not in it are as the machine file says.
        measured: recordings.
        settings: of the machine file.
        felt: the columns.
    """
    stage = composed(settings, models)
    axis = next(a for a in settings.axes if a.name == name)
    parts: list[tuple[F64, F64, F64, NDArray[np.int64]]] = []
    strokes = 0
    for m in measured:
        left = residual(m.replay.measured(), m.replay.run(stage))[name]
        signals = m.replay.recording.axes[name]
        time = m.replay.recording.time
        position = signals.position_actual
        speed = np.gradient(signals.position_demand, time)
        # Where friction changes faster than the controller follows, it moves the stage instead.
        moved = np.gradient(np.gradient(left["position"], time), time)
        moving = m.replay.valid(name) & (np.abs(speed) > _MOVING)
        number = strokes + np.cumsum(np.diff(moving.astype(np.int64), prepend=0) == 1)
        strokes = int(number[-1])
        parts.append(
            (
                _neutral(position, speed, np.gradient(speed, time))[moving],
                felt(position, speed, float(time[1] - time[0]))[moving],
                (left["force"] - axis.mass * moved)[moving],
                number[moving],
            )
        )
    neutral, own, force, stroke = (np.concatenate(each) for each in zip(*parts, strict=True))
    passed = np.abs(own).sum(axis=0)
    if len(force) < _FEWEST or strokes < _STROKES:
        return Told(0.0, 0.0, np.zeros(own.shape[1]), passed)
    columns = np.hstack([neutral, own])
    plain = _foretold(neutral, force, stroke)
    share = 1.0 - _foretold(columns, force, stroke) / max(plain, 1e-300)
    found = np.linalg.lstsq(columns, force, rcond=_SILENT)[0]
    return Told(share, float(found[_LEVEL]), found[neutral.shape[1] :], passed)


def stops(position: F64, widths: F64) -> F64:
    """Elements that go along with the travel and slide at 1.

    Args:
        position: float64[T] [m].
        widths: travel from the middle until they slide, float64[K] [m].

    Returns:
        float64[T, K], -1..1; 0 at first.
    """
    return np.asarray(_stops(np.ascontiguousarray(position), widths))


@njit(cache=True)
def _stops(position: F64, widths: F64) -> F64:
    out = np.zeros((len(position), len(widths)))
    for t in range(1, len(position)):
        moved = position[t] - position[t - 1]
        for k in range(len(widths)):
            out[t, k] = min(max(out[t - 1, k] + moved / widths[k], -1.0), 1.0)
    return out


def _neutral(position: F64, speed: F64, acceleration: F64) -> F64:
    """What base parameters, drag and a spring make, float64[T, N]."""
    plain = [np.ones_like(speed), np.sign(speed), speed, speed * np.abs(speed)]
    plain += [acceleration, position]
    return np.column_stack([*plain, stops(position, np.array(_PRESLIDING))])


def _foretold(columns: F64, force: F64, stroke: NDArray[np.int64]) -> float:
    """Energy left on strokes (in pairs) that a fit to all others foretells [N^2]."""
    scale = np.sqrt(np.square(columns).mean(axis=0)) + 1e-300
    columns = columns / scale
    pair = stroke // 2
    parts = [(columns[pair == each], force[pair == each]) for each in np.unique(pair)]
    grams = [part.T @ part for part, _ in parts]
    loads = [part.T @ own for part, own in parts]
    gram, load = np.sum(grams, axis=0), np.sum(loads, axis=0)
    energy = 0.0
    for (part, own), left_gram, left_load in zip(parts, grams, loads, strict=True):
        found = np.linalg.lstsq(gram - left_gram, load - left_load, rcond=_SILENT**2)[0]
        energy += float(np.square(own - part @ found).sum())
    return energy
