"""Encoder noise and friction wander of the simulated stage, drawn in order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings

F64 = NDArray[np.float64]


class Noise:
    """Encoder noise and friction wander, drawn in order from one stream per axis and source.

    seed None: none of either.
    """

    def __init__(self, axes: int, seed: int | None) -> None:
        self._axes = axes
        self._streams = (
            None
            if seed is None
            else [
                [np.random.default_rng([seed, axis, source]) for source in range(2)]
                for axis in range(axes)
            ]
        )

    def start_wander(self, settings: StageSettings) -> F64:
        """A stationary first value of the factor on Fc, per axis."""
        if self._streams is None:
            return np.zeros(self._axes)
        return np.array(
            [
                stream[1].standard_normal() * axis.friction.wander
                for stream, axis in zip(self._streams, settings.axes, strict=True)
            ]
        )

    def draw(self, ticks: int) -> F64:
        """Standard normals for the next ticks, shape (axes, 2, ticks)."""
        if self._streams is None:
            return np.zeros((self._axes, 2, ticks))
        return np.array([[s.standard_normal(ticks) for s in pair] for pair in self._streams])
