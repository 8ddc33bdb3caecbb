"""A model fitted to the free loop, as the dictionary of candidates asks for it.

Pitches and frequencies are sought where the residual force has its peaks.
"""

from __future__ import annotations

import math

import numpy as np

from hil_sim.effects import Effect, Parameter
from sim2real.dictionary import Dictionary, Linearised, typical
from sim2real.fitting import STEP, Fitted
from sim2real.free_loop.fit import derivatives, free_cost
from sim2real.free_loop.loop import FreeLoop
from stagedata import F64, BoolArray

_PEAKS, _BESIDE, _BEYOND = 3, 0.35, 1.5
"""Number of peaks of the residual force that are tried for a pitch or frequency; distance to a line
tried on either side of each, in waves over the whole extent; and the factor by which peaks may lie
beyond the plausible range."""


class FreeDictionary(Dictionary):
    """Candidates on an axis beside a model that has been fitted to the free loop.

    Args:
        loop: the axis.
        fitted: the model.
        moves: that count, bool[moves]; None for all.

    Attributes:
        base_columns: derivatives by the base parameters, float64[R, STEP].
    """

    def __init__(self, loop: FreeLoop, fitted: Fitted, moves: BoolArray | None = None) -> None:
        self._loop = loop
        self._fitted = fitted
        self._own = np.ones(len(loop.move), dtype=np.bool_) if moves is None else moves[loop.move]
        self._power: dict[tuple[str, bool], F64] = {}
        energy = float(np.mean(fitted.residual[self._own] ** 2))
        slopes = derivatives(loop, fitted.model, fitted.residual)
        self.base_columns: F64 = slopes[:, :STEP]
        super().__init__(
            Linearised(
                loop.axis,
                fitted.model,
                fitted.residual,
                self._own / math.sqrt(loop.coherent * max(energy, 1.0)),
                slopes,
                np.eye(STEP, slopes.shape[1]),
                fitted.model.base[:STEP] / loop.spread,
                loop.travelled,
                self._waves,
                loop.residuals,
                lambda there: free_cost(loop, fitted.model, there, moves),
            )
        )

    def _waves(self, effect: Effect, parameter: Parameter) -> list[float] | None:
        """Pitches [m] or frequencies [Hz] of the highest peaks of the residual force."""
        if all(p.role != "phase" for p in effect.parameters):
            return None
        low, high = parameter.ranges(self._loop.axis)[0]
        low, high = max(low / _BEYOND, parameter.least), high * _BEYOND
        over_travel = parameter.unit == "m"
        lines = self._loop.wave_lines(over_travel)
        ports = typical(effect, self._loop.axis).ports(self._loop.axis)
        key = parameter.unit, ports.position_gain is not None  # of a factor on the motor force
        if key not in self._power:
            self._power[key] = self._loop.wave_power(
                self._fitted.residual, self._fitted.model, over_travel, self._own, key[1]
            )
        values = 1.0 / lines if over_travel else lines
        power = np.where((values >= low) & (values <= high), self._power[key], 0.0)
        extent = self._loop.extent if over_travel else self._loop.duration
        found: list[float] = []
        while len(found) < 3 * _PEAKS and power.max() > 0.0:
            peak = int(power.argmax())
            beside = lines[peak] + np.array([0.0, -_BESIDE, _BESIDE]) / extent
            found += [float(v) for v in (1.0 / beside if over_travel else beside) if v > 0.0]
            power = np.where(np.abs(lines - lines[peak]) < 1.0 / extent, 0.0, power)
        return found
