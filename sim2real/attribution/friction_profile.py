"""Whether the residual force in motion is friction that varies over position.

Its profile is free, linear between nodes, and fitted to all strokes but two, on which it is then
evaluated. Unlike a force over position it changes sign with the velocity. Sliding friction follows
its level with the time constant Fc/C, so at speed it lags behind the profile, and short waves
hardly show. Changes over time, and what friction of a constant level, viscous friction, drag,
another mass, a spring, a constant force and presliding explain, do not count.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil_sim.settings import StageSettings
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import Measured, subtract_signals
from stagedata.compiled import kernel

F64 = NDArray[np.float64]

_SLIDING = 1e-4
"""Demanded velocity from which friction relaxes [m/s]."""
_PITCH = 2e-3
"""Distance of the nodes [m]."""
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


@dataclass(frozen=True, slots=True, eq=False)
class FrictionProfile:
    """Friction over position.

    Attributes:
        share: of the residual force in motion that it predicts on strokes it was not fitted to, 1
            (all of it) or less; 0 or less: the force is of another kind.
        places: of its N nodes, float64[N] [m].
        heights: excess over the machine file's Coulomb force there (0.1 = 10 %), float64[N].
        passed: weight of the samples at each node, float64[N].
    """

    share: float
    places: F64
    heights: F64
    passed: F64


def fit_friction_profile(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> FrictionProfile:
    """Fit a friction profile to what a model leaves in motion.

    Args:
        name: of the axis.
        models: axis -> its model; axes without one are as the machine file says.
        measured: recordings.
        settings: of the machine file.
    """
    stage = compose_stage(settings, models)
    axis = next(a for a in settings.axes if a.name == name)
    nodes = _nodes(name, measured)
    parts: list[tuple[F64, F64, F64, NDArray[np.int64]]] = []
    strokes = 0
    for m in measured:
        residual = subtract_signals(m.replay.measured(), m.replay.run(stage))[name]
        signals = m.replay.recording.axes[name]
        time = m.replay.recording.time
        position = signals.position_actual
        speed = np.gradient(signals.position_demand, time)
        kept = math.exp(-axis.friction.relaxation_rate * float(time[1] - time[0]))
        felt = np.sign(speed)[:, None] * _lagged_hats(position, speed, nodes, kept)
        # Where friction changes faster than the controller can follow, it accelerates the stage.
        moved = np.gradient(np.gradient(residual["position"], time), time)
        moving = m.replay.valid(name) & (np.abs(speed) > _MOVING)
        number = strokes + np.cumsum(np.diff(moving.astype(np.int64), prepend=0) == 1)
        strokes = int(number[-1])
        parts.append(
            (
                _base_regressors(position, speed, np.gradient(speed, time))[moving],
                felt[moving],
                (residual["force"] - axis.mass * moved)[moving],
                number[moving],
            )
        )
    base, hats, force, stroke = (np.concatenate(each) for each in zip(*parts, strict=True))
    passed = np.abs(hats).sum(axis=0)
    if len(force) < _FEWEST or strokes < _STROKES:
        return FrictionProfile(0.0, nodes, np.zeros(len(nodes)), passed)
    columns = np.hstack([base, hats])
    plain = _held_out_energy(base, force, stroke)
    share = 1.0 - _held_out_energy(columns, force, stroke) / max(plain, 1e-300)
    solved = np.linalg.lstsq(columns, force, rcond=_SILENT)[0]
    heights = (solved[_LEVEL] + solved[base.shape[1] :]) / axis.friction.coulomb
    return FrictionProfile(share, nodes, heights, passed)


def _nodes(name: str, measured: Sequence[Measured]) -> F64:
    """Nodes of the profile over the whole travel, float64[N] [m]."""
    travelled = [m.replay.recording.axes[name].position_actual for m in measured]
    low = min(float(each.min()) for each in travelled)
    high = max(float(each.max()) for each in travelled)
    return np.linspace(low, high, max(2, round((high - low) / _PITCH) + 1))


def _lagged_hats(position: F64, speed: F64, nodes: F64, kept: float) -> F64:
    """Hat functions of the nodes, delayed as sliding friction follows its level.

    Args:
        position: float64[T] [m].
        speed: demanded, float64[T] [m/s].
        nodes: float64[N], evenly spaced [m].
        kept: share of the previous sample while sliding.

    Returns:
        float64[T, N]; not delayed at rest.
    """
    place = np.clip((position - nodes[0]) / (nodes[1] - nodes[0]), 0.0, len(nodes) - 1.001)
    index = place.astype(np.int64)
    rows = np.arange(len(position))
    hats = np.zeros((len(position), len(nodes)))
    hats[rows, index] = 1.0 - (place - index)
    hats[rows, index + 1] = place - index
    sliding = np.abs(speed) > _SLIDING
    if sliding.any():
        moved = hats[sliding]
        hats[sliding] = lfilter([1.0 - kept], [1.0, -kept], moved, axis=0, zi=kept * moved[:1])[0]
    return hats


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
    for (part, own), held_gram, held_load in zip(parts, grams, loads, strict=True):
        solved = np.linalg.lstsq(gram - held_gram, load - held_load, rcond=_SILENT**2)[0]
        energy += float(np.square(own - part @ solved).sum())
    return energy
