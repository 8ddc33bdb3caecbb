"""The residual force that a model leaves in motion, and the share that a kind of effect predicts.

Some effects come in any shape, such as friction over position. Whether the residual is of such a
kind is tested without assuming a shape: regressors that only this kind has are fitted to all
strokes but two and evaluated on these two. Changes over time, and what friction of a constant
level, viscous friction, drag, another mass, a spring, a constant force and presliding explain, do
not count.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import Measured, subtract_signals
from stagedata.compiled import kernel

F64 = NDArray[np.float64]
Regressors = Callable[[F64, F64, float], F64]
"""Regressors float64[T, K] of positions float64[T] [m], demanded velocities float64[T] [m/s] and
the time between them [s]."""

_MOVING = 0.02
"""Demanded velocity from which friction has the sign of the velocity [m/s]."""
_FEWEST, _STROKES = 200, 8
"""Samples in motion and strokes that a verdict needs."""
_SILENT = 1e-3
"""Singular values below this share of the largest are left out: they are of places that the axis
hardly passed."""
_PRESLIDING = (2e-5, 5e-5)
"""Travel after a reversal in which friction of another stiffness or level differs [m]."""
_LEVEL = 1
"""Base regressor that is a level of Coulomb friction."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """How far regressors of one kind explain the residual force in motion.

    Attributes:
        share: that they predict on strokes they were not fitted to, 1 (all of it) or less; 0 or
            less: the force is of another kind.
        level: Coulomb friction beside them [N].
        weights: of the regressors, float64[K] [N].
        passed: sum of each regressor's absolute values, float64[K].
    """

    share: float
    level: float
    weights: F64
    passed: F64


def explain_residual_force(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
    regressors: Regressors,
) -> Explanation:
    """Fit what a model leaves in motion by regressors of one kind.

    Args:
        name: of the axis.
        models: axis -> its model; axes without one are as the machine file says.
        measured: recordings.
        settings: of the machine file.
        regressors: the regressors.
    """
    stage = compose_stage(settings, models)
    axis = next(a for a in settings.axes if a.name == name)
    parts: list[tuple[F64, F64, F64, NDArray[np.int64]]] = []
    strokes = 0
    for m in measured:
        left = subtract_signals(m.replay.measured(), m.replay.run(stage))[name]
        signals = m.replay.recording.axes[name]
        time = m.replay.recording.time
        position = signals.position_actual
        speed = np.gradient(signals.position_demand, time)
        # Where friction changes faster than the controller can follow, it accelerates the stage.
        moved = np.gradient(np.gradient(left["position"], time), time)
        moving = m.replay.valid(name) & (np.abs(speed) > _MOVING)
        number = strokes + np.cumsum(np.diff(moving.astype(np.int64), prepend=0) == 1)
        strokes = int(number[-1])
        parts.append(
            (
                _base_regressors(position, speed, np.gradient(speed, time))[moving],
                regressors(position, speed, float(time[1] - time[0]))[moving],
                (left["force"] - axis.mass * moved)[moving],
                number[moving],
            )
        )
    neutral, own, force, stroke = (np.concatenate(each) for each in zip(*parts, strict=True))
    passed = np.abs(own).sum(axis=0)
    if len(force) < _FEWEST or strokes < _STROKES:
        return Explanation(0.0, 0.0, np.zeros(own.shape[1]), passed)
    columns = np.hstack([neutral, own])
    plain = _held_out_energy(neutral, force, stroke)
    share = 1.0 - _held_out_energy(columns, force, stroke) / max(plain, 1e-300)
    found = np.linalg.lstsq(columns, force, rcond=_SILENT)[0]
    return Explanation(share, float(found[_LEVEL]), found[neutral.shape[1] :], passed)


def stop_operators(position: F64, widths: F64) -> F64:
    """Stop operators (Prandtl): the travel over the width, held at -1 and 1 until it reverses.

    Args:
        position: float64[T] [m].
        widths: travel from the middle until they slide, float64[K] [m].

    Returns:
        float64[T, K], -1..1; 0 at first.
    """
    return np.asarray(_run_stop_operators(np.ascontiguousarray(position), widths))


@kernel(error_model="python")
def _run_stop_operators(position: F64, widths: F64) -> F64:
    """Stop operators float64[T, K] of positions float64[T] [m] and widths float64[K] [m]."""
    out = np.zeros((len(position), len(widths)))
    for t in range(1, len(position)):
        moved = position[t] - position[t - 1]
        for k in range(len(widths)):
            out[t, k] = min(max(out[t - 1, k] + moved / widths[k], -1.0), 1.0)
    return out


def _base_regressors(position: F64, speed: F64, acceleration: F64) -> F64:
    """Regressors of base parameters, drag, a spring and presliding, float64[T, N]."""
    plain = [np.ones_like(speed), np.sign(speed), speed, speed * np.abs(speed)]
    plain += [acceleration, position]
    return np.column_stack([*plain, stop_operators(position, np.array(_PRESLIDING))])


def _held_out_energy(columns: F64, force: F64, stroke: NDArray[np.int64]) -> float:
    """Energy left on strokes (in pairs), each predicted by a fit to all others [N^2]."""
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
