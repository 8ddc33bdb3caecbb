"""How well the force of a motion repeats: what no model can leave less of.

Strokes that repeat each other take the same force but for noise and friction's wander, whatever
forces a model lacks: these are the same in both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sim2real.open_loop.motion import Motion
from stagedata import F64

_ALIKE = 0.03
"""Largest difference in start, end and usual speed between strokes that repeat each other, as
shares of the travel and of the speed."""
_PLACES = 20
"""Places along a stroke at which forces are compared."""
_FEWEST = 4
"""Repetitions that are needed."""


@dataclass(frozen=True, slots=True, eq=False)
class _Kind:
    """Strokes that repeat each other.

    Attributes:
        figures: start and end over the travel, logarithm of the usual speed, float64[3].
        places: along them, float64[`_PLACES`] [m].
        forces: at these places, float64[`_PLACES`] each [N].
    """

    figures: F64
    places: F64
    forces: list[F64] = field(default_factory=list)


def scatter_of_repeats(motion: Motion, name: str, left: F64) -> float | None:
    """Scatter of an axis' force between strokes that repeat each other [N rms].

    Args:
        motion: of the recording.
        name: of the axis.
        left: force that a model leaves, low-passed, float64[P] [N].

    Returns:
        None where too few strokes repeat.
    """
    own = motion.axes[name]
    extent = max(float(np.ptp(own.position)), 1e-12)
    kinds: list[_Kind] = []
    for stroke in motion.recording.moves:
        inside = np.flatnonzero(own.usable[stroke.start : stroke.end]) + stroke.start
        speed = float(np.median(np.abs(own.velocity[inside]))) if len(inside) else 0.0
        if len(inside) < _PLACES or speed <= 0.0:
            continue
        position = own.position[inside]
        figures = np.append(position[[0, -1]] / extent, math.log(speed))
        kind = next((k for k in kinds if np.abs(figures - k.figures).max() < _ALIKE), None)
        if kind is None:
            places = np.linspace(float(position[0]), float(position[-1]), _PLACES)
            kinds.append(kind := _Kind(figures, places))
        way = math.copysign(1.0, position[-1] - position[0])
        kind.forces.append(np.interp(way * kind.places, way * position, left[inside]))
    # Second differences: a drift from stroke to stroke is no scatter.
    changes = [np.diff(kind.forces, 2, axis=0) for kind in kinds if len(kind.forces) > 2]
    if sum(len(each) for each in changes) < _FEWEST:
        return None
    # The median: where the acceleration changes, forces depend on the instants of sampling.
    return 1.4826 / math.sqrt(6.0) * float(np.median(np.abs(np.concatenate(changes))))
