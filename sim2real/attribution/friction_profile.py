"""Whether the force that a model leaves in motion is friction that differs from place to place.

Any profile will do, linear between nodes: what it leaves has the sign of the velocity, other than
what any force over position does. Sliding friction follows another level at its relaxation rate
(C/Fc): at speed a profile is felt late, and its short waves hardly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil_sim.settings import StageSettings
from sim2real.attribution.residual_force import told
from sim2real.fitting import AxisModel
from sim2real.gap import Measured

F64 = NDArray[np.float64]

_SLIDING = 1e-4
"""Demanded velocity from which friction relaxes [m/s]."""
_PITCH = 2e-3
"""Of the nodes [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class FrictionProfile:
    """Friction over position.

    Attributes:
        share: of the force left in motion that it foretells (`sim2real.left_in_motion`).
        places: of its nodes, float64[N] [m].
        heights: there, surplus over the machine file's Coulomb force (0.1 = 10 %), float64[N].
        passed: samples that tell of each node, float64[N].
    """

    share: float
    places: F64
    heights: F64
    passed: F64


def friction_profile(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> FrictionProfile:
    """Fit a friction profile to what a model leaves; arguments as `left_in_motion.told`."""
    friction = next(a for a in settings.axes if a.name == name).friction
    nodes = _nodes(name, measured)
    rate = friction.attraction / friction.coulomb

    def felt(position: F64, speed: F64, step: float) -> F64:
        return np.sign(speed)[:, None] * _felt(position, speed, nodes, math.exp(-rate * step))

    found = told(name, models, measured, settings, felt)
    heights = (found.level + found.weights) / friction.coulomb
    return FrictionProfile(found.share, nodes, heights, found.passed)


def _nodes(name: str, measured: Sequence[Measured]) -> F64:
    """Places between which a profile is linear, over all that was travelled [m]."""
    travelled = [m.replay.recording.axes[name].position_actual for m in measured]
    low = min(float(each.min()) for each in travelled)
    high = max(float(each.max()) for each in travelled)
    return np.linspace(low, high, max(2, round((high - low) / _PITCH) + 1))


def _felt(position: F64, speed: F64, nodes: F64, kept: float) -> F64:
    """What friction feels of each node: its hat, as late as sliding friction follows.

    Args:
        position: float64[T] [m].
        speed: demanded, float64[T] [m/s].
        nodes: float64[N], evenly spaced [m].
        kept: share of the sample before, while it slides.

    Returns:
        float64[T, N]; at rest not late.
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
