"""Encoder noise and friction wander of the simulated stage, drawn in order."""

from __future__ import annotations

import numpy as np

from hil_sim.settings import StageSettings
from stagedata import F64


class Noise:
    """Random numbers from one stream per axis and source (encoder noise, friction wander).

    Args:
        axes: number of axes.
        seed: of all streams; None: no noise.
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

    def draw_initial_wander(self, settings: StageSettings) -> F64:
        """Draw the initial wander of each axis from its stationary distribution, float64[axes]."""
        if self._streams is None:
            return np.zeros(self._axes)
        return np.array(
            [
                stream[1].standard_normal() * axis.wander
                for stream, axis in zip(self._streams, settings.axes, strict=True)
            ]
        )

    def draw(self, ticks: int) -> F64:
        """Draw standard normals for the next ticks, float64[axes, 2, ticks].

        C-contiguous always: it goes to machine code that has been compiled for such arrays alone
        and checks nothing (`stagedata.compiled.machine_code`).
        """
        if self._streams is None:
            return np.zeros((self._axes, 2, ticks))
        return np.array([[s.standard_normal(ticks) for s in pair] for pair in self._streams])
