"""Whether the residual force in motion is friction that varies over position.

The profile is free, linear between nodes. Unlike a force over position it changes sign with the
velocity. Sliding friction follows its level with the time constant Fc/C, so at speed it lags behind
the profile, and short waves hardly show.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil_sim.settings import StageSettings
from sim2real.attribution.residual_force import explain_residual_force
from sim2real.fitting import AxisModel
from sim2real.gap import Measured

F64 = NDArray[np.float64]

_SLIDING = 1e-4
"""Demanded velocity from which friction relaxes [m/s]."""
_PITCH = 2e-3
"""Distance of the nodes [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class FrictionProfile:
    """Friction over position.

    Attributes:
        share: of the residual force in motion that it predicts
            (`sim2real.attribution.residual_force`).
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
    """Fit a friction profile to what a model leaves; arguments as `explain_residual_force`."""
    friction = next(a for a in settings.axes if a.name == name).friction
    nodes = _nodes(name, measured)
    rate = friction.relaxation_rate

    def felt(position: F64, speed: F64, step: float) -> F64:
        return np.sign(speed)[:, None] * _lagged_hats(
            position, speed, nodes, math.exp(-rate * step)
        )

    found = explain_residual_force(name, models, measured, settings, felt)
    heights = (found.level + found.weights) / friction.coulomb
    return FrictionProfile(found.share, nodes, heights, found.passed)


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
