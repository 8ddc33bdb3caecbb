"""Margins of the loop that an observer closes, by the measured response of the axis.

The loop is closed at SYNC: from a force offset through the axis, its drive's loop closed, to the
sampled position, and through the observer back to the offset. The measured response holds all of
the first part, whatever it consists of; the observer is known exactly. What is asked of their
product L needs no model of the axis: no gain up to twice the chosen one may reach instability
(L does not cross the real axis left of -1/2), and the sensitivity stays below its bound.

See docs/reference/observer.md, what is measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.observer.model import LACK, ObserverModel
from estimation.response import AxisResponse, Clocking, FrequencyResponse, Lines

C128 = NDArray[np.complex128]

GAIN_MARGIN = 2.0
"""The loop stays stable with so many times the gain."""
SIGMAS = 2.0
"""Uncertainty of the response that counts against the loop."""
STATES = (0.0, 0.5, 1.0)
"""Between sliding (0) and rest (1), friction sticks in part: stiffness adds to 1/response."""


@dataclass(frozen=True, slots=True)
class Margins:
    """Of one loop.

    Attributes:
        gain: factor to instability; infinite where none is near.
        peak: of the sensitivity.
    """

    gain: float
    peak: float


class MeasuredLoop:
    """A measured axis, ready to be judged with any observer.

    Args:
        response: of the axis.
        clocking: of its drive.
    """

    def __init__(self, response: AxisResponse, clocking: Clocking) -> None:
        at = response.sliding.offset_at
        self._z = np.exp(2j * math.pi * at * clocking.period)
        hold = Lines(at, clocking).setpoint_hold
        self._states = [
            (_mixed(response, share, "offset"), 1.0 - _mixed(response, share, "demand") / hold)
            for share in (STATES if not response.sticks else STATES[:1])
        ]
        states = (response.sliding,) if response.sticks else response
        doubt = [state.offset_sigma / np.abs(state.offset) for state in states]
        self._doubt = 1.0 + SIGMAS * np.max(doubt, axis=0)

    @property
    def drive_peaks(self) -> tuple[float, ...]:
        """Peak sensitivity, a ratio, of the drive alone in each of `STATES`."""
        return tuple(float(np.abs(alone).max()) for _, alone in self._states)

    def loops(self, model: ObserverModel, gain: float, latency: int = 1) -> list[C128]:
        """The loop closed at SYNC in each of `STATES`, uncertainty included, (L,) each.

        `gain` is the share of the error corrected per SYNC; arguments as of `margins`.
        """
        back = correction_by_deviation(model, gain, self._z) * self._z ** (1 - latency)
        return [-to_offset * back * self._doubt for to_offset, _ in self._states]

    def margins(self, model: ObserverModel, gain: float, latency: int = 1) -> tuple[Margins, ...]:
        """Margins in each of `STATES`.

        Args:
            model: of the observer.
            gain: g of its correction.
            latency: SYNC periods from a sample to its offset.
        """
        found = []
        for loop, (_, alone) in zip(self.loops(model, gain, latency), self._states, strict=True):
            peak = float(np.abs(alone / (1.0 + loop)).max())
            found.append(Margins(_gain_margin(loop), peak))
        return tuple(found)


def correction_by_deviation(model: ObserverModel, gain: float, z: C128) -> C128:
    """An observer's correction by the sampled deviation, both at SYNC, at each z [N/m], (L,).

    It includes that the observer knows which offsets were sent.
    """
    states = len(model.transition)
    corrected = model.transition @ model.gain
    inner = model.transition.copy()
    inner[:, 0] -= corrected
    known = model.ramp_to + model.ramp_from / z[:, None]
    inputs = np.stack((np.broadcast_to(corrected, known.shape), known), axis=2)
    seen = np.linalg.solve(z[:, None, None] * np.eye(states) - inner, inputs)[:, LACK]
    share = gain / model.force_ratio * z
    return share * seen[:, 0] / (z - 1.0 + gain - share * seen[:, 1])


def _gain_margin(loop: C128) -> float:
    """Least factor above 0 at which the loop's curve passes through -1."""
    x, y = loop.real, loop.imag
    crosses = np.flatnonzero(y[:-1] * y[1:] <= 0.0)
    share = y[crosses] / np.where(y[crosses] == y[crosses + 1], 1.0, y[crosses] - y[crosses + 1])
    at = x[crosses] + share * (x[crosses + 1] - x[crosses])
    worst = float(at.min(initial=0.0))
    return math.inf if worst >= 0.0 else -1.0 / worst


def _mixed(response: AxisResponse, share: float, which: str) -> C128:
    """The response where friction sticks by a share."""

    def of(state: FrequencyResponse) -> C128:
        return state.offset if which == "offset" else state.on_offset_lines()

    if share == 0.0:
        return of(response.sliding)
    return 1.0 / ((1.0 - share) / of(response.sliding) + share / of(response.rest))
