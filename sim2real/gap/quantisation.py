"""The resolution of a log, where it is coarser than encoder and drive."""

from __future__ import annotations

import math

import numpy as np

from hil_sim.settings import AxisSettings
from stagedata import AxisSignals, FloatArray

_COARSER = 1.5
"""A log this many times as coarse as its sensor has a resolution of its own."""


def stated_step(axis: AxisSettings, signal: str) -> float:
    """Step of a signal ("position", "force") by the machine file [m, N]."""
    return axis.increment if signal == "position" else axis.control.rated_force / 1000.0


def coarse_steps(signals: AxisSignals, axis: AxisSettings) -> dict[str, float]:
    """Steps of the signals that are logged more coarsely than encoder and drive measure [m, N].

    Args:
        signals: as logged.
        axis: its settings.

    Returns:
        Signal ("position", "force") -> step; signals as fine as their sensors are left out.
    """
    logged = {"position": signals.position_actual, "force": signals.force_actual}
    found = {name: quantisation_step(values[signals.valid]) for name, values in logged.items()}
    return {
        name: step
        for name, step in found.items()
        if step is not None and step > _COARSER * stated_step(axis, name)
    }


def quantisation_step(values: FloatArray) -> float | None:
    """The step that values, float64[K], are multiples of, in their unit; None without one."""
    levels = np.unique(values)
    if len(levels) < 3:
        return None
    gaps = np.diff(levels)
    smallest = float(gaps[gaps > 1e-9 * np.ptp(levels) + 1e-15].min(initial=math.inf))
    if not math.isfinite(smallest):
        return None
    # The smallest gap is rounded: the step is refined over the whole range.
    multiples = np.rint((levels - levels[0]) / smallest)
    if multiples[-1] > 1e7:
        return smallest if _is_on_grid(gaps, smallest) else None
    step = float((levels[-1] - levels[0]) / multiples[-1])
    return step if _is_on_grid(gaps, step) else None


def _is_on_grid(gaps: FloatArray, step: float) -> bool:
    off = np.abs(gaps / step - np.rint(gaps / step))
    return bool(np.mean(off < 0.02) > 0.99)
