"""How well the force of a motion repeats: what no model can leave less of.

Strokes that repeat each other take the same force but for noise and friction's wander, whatever
forces a model lacks: these are the same in both.
"""

from __future__ import annotations

import math

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
    kinds: list[tuple[F64, list[F64]]] = []
    for stroke in motion.recording.moves:
        inside = np.flatnonzero(own.usable[stroke.start : stroke.end]) + stroke.start
        if len(inside) < _PLACES:
            continue
        first, last = inside[0], inside[-1]
        speed = float(np.median(np.abs(own.velocity[inside])))
        if speed <= 0.0:
            continue
        share = (inside - first) / (last - first)
        along = np.interp(np.linspace(0.0, 1.0, _PLACES), share, left[inside])
        kind = np.append(own.position[[first, last]] / extent, math.log(speed))
        for other, repeats in kinds:
            if np.abs(kind - other).max() < _ALIKE:
                repeats.append(along)
                break
        else:
            kinds.append((kind, [along]))
    # Second differences: a drift from stroke to stroke is no scatter.
    changes = [np.diff(each, 2, axis=0) for _, each in kinds if len(each) > 2]
    if sum(len(each) for each in changes) < _FEWEST:
        return None
    # The median: where the acceleration changes, forces depend on the instants of sampling.
    return 1.4826 / math.sqrt(6.0) * float(np.median(np.abs(np.concatenate(changes))))
