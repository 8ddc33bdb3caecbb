"""Whether the force that a model leaves in motion is friction that differs from place to place.

Any profile will do, linear between nodes: what it leaves has the sign of the velocity, other than
what any force over position does. Strokes that it was not fitted to decide, so that what changes
with time is not taken for it; what friction of a constant level, viscous friction, drag and a
constant force take up does not count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.axis_model import AxisModel, composed
from sim2real.gap import Measured
from sim2real.replay import residual

F64 = NDArray[np.float64]

_MOVING = 0.02
"""Demanded velocity from which friction has the sign of the velocity [m/s]."""
_FEWEST, _STROKES = 200, 8
"""Samples in motion and strokes that a profile needs."""
_PITCH = 2e-3
"""Of its nodes [m]."""
_SILENT = 1e-3
"""Singular values below this share of the largest say nothing: nodes that were hardly passed."""
_NEUTRAL = 4
"""Columns that are no profile."""


@dataclass(frozen=True, slots=True)
class Profile:
    """Friction over position.

    Attributes:
        share: of the force left in motion that it foretells on strokes it was not fitted to,
            1 (all of it) or less; 0 or less: it is none.
        center: where it is farthest from its mean, for as often as it was passed [m].
        height: how far there, over the Coulomb force.
    """

    share: float
    center: float = 0.0
    height: float = 0.0


def friction_profile(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> Profile:
    """Fit a friction profile to what a model leaves.

    Args:
        name: of the axis.
        models: axis -> its model; axes that are not in it are as the machine file says.
        measured: recordings.
        settings: of the machine file.
    """
    stage = composed(settings, models)
    axis = next(a for a in settings.axes if a.name == name)
    where, velocity, force, stroke = [], [], [], []
    strokes = 0
    for m in measured:
        left = residual(m.replay.measured(), m.replay.run(stage))[name]
        signals = m.replay.recording.axes[name]
        time = m.replay.recording.time
        speed = np.gradient(signals.position_demand, time)
        # Where friction changes faster than the controller follows, it moves the stage instead.
        moved = np.gradient(np.gradient(left["position"], time), time)
        moving = m.replay.valid(name) & (np.abs(speed) > _MOVING)
        number = strokes + np.cumsum(np.diff(moving.astype(np.int64), prepend=0) == 1)
        strokes = int(number[-1])
        where.append(signals.position_actual[moving])
        velocity.append(speed[moving])
        force.append((left["force"] - axis.mass * moved)[moving])
        stroke.append(number[moving])
    x, v, f, k = (np.concatenate(parts) for parts in (where, velocity, force, stroke))
    if len(f) < _FEWEST or strokes < _STROKES:
        return Profile(0.0)
    sign = np.sign(v)
    low, high = float(x.min()), float(x.max())
    nodes = np.linspace(low, high, max(2, round((high - low) / _PITCH) + 1))
    place = np.clip((x - low) / (nodes[1] - nodes[0]), 0.0, len(nodes) - 1.001)
    index = place.astype(np.int64)
    columns = np.zeros((len(f), _NEUTRAL + len(nodes)))
    columns[:, :_NEUTRAL] = np.column_stack([np.ones_like(sign), sign, v, v * np.abs(v)])
    rows = np.arange(len(f))
    columns[rows, _NEUTRAL + index] = sign * (1.0 - (place - index))
    columns[rows, _NEUTRAL + index + 1] = sign * (place - index)
    plain = _foretold(columns[:, :_NEUTRAL], f, k)
    share = 1.0 - _foretold(columns, f, k) / max(plain, 1e-300)
    heights = np.linalg.lstsq(columns, f, rcond=_SILENT)[0][_NEUTRAL:]
    passed = np.abs(columns[:, _NEUTRAL:]).sum(axis=0)
    heights = heights - (passed @ heights) / passed.sum()
    top = int(np.argmax(np.abs(heights) * np.sqrt(passed)))
    return Profile(share, float(nodes[top]), float(heights[top]) / axis.friction.coulomb)


def _foretold(columns: F64, force: F64, stroke: NDArray[np.int64]) -> float:
    """Energy left on strokes (in pairs) that a fit to all others foretells [N^2]."""
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
