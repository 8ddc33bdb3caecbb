"""Responses of an axis in its drive's loop in closed form, for fitting.

The drive's law is taken at its control ticks, the mechanics in continuous time, and both meet in
the frequency domain; sampling at SYNC folds the parts of higher frequencies. Neither the simulator
nor the observer's matrices (`estimation.observer.loop`) are used: what is fitted here judges those.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stagedata import F64

C128 = NDArray[np.complex128]

_FOLDED = 1
"""Multiples of the SYNC rate, either way, whose parts are folded."""


class Resonance(NamedTuple):
    """A mode seen between force and position.

    Attributes:
        frequency: with the drive's loop open [Hz].
        damping: ratio.
        share: its compliance times (2 pi frequency)^2, over that of the rigid mass (1/m); negative
            where the encoder sits beyond a spring.
    """

    frequency: float
    damping: float
    share: float


class Figures(NamedTuple):
    """An axis and its drive, in units of force offsets.

    Attributes:
        mass: force offset per acceleration [kg].
        kp, ki, kd: gains [N/m, N/(m s), N s/m].
        derivative_time: of the derivative's low-pass [s].
        dead_time: inside the drive's loop, besides its current loop [s].
        lateness: of force offsets, besides it and the ramp of a period [s].
        age: of a sampled position [s].
        smoothing: time constant of a low-pass on sampled positions only [s].
        viscous: coefficient while sliding [N s/m]; may be negative where friction falls with speed.
        stiffness, loss: of friction at rest [N/m, N s/m].
        sign: of force offsets, 1 or -1.
        resonances: of the mechanics.
    """

    mass: float
    kp: float
    ki: float
    kd: float
    derivative_time: float
    dead_time: float = 0.0
    lateness: float = 0.0
    age: float = 0.0
    smoothing: float = 0.0
    viscous: float = 0.0
    stiffness: float = 0.0
    loss: float = 0.0
    sign: float = 1.0
    resonances: tuple[Resonance, ...] = ()


class Clocking(NamedTuple):
    """Fixed figures of a drive.

    Attributes:
        period: Ts [s].
        control_period: Tc [s].
        current_bandwidth: of the current loop [Hz].
    """

    period: float
    control_period: float
    current_bandwidth: float


class Lines:
    """Frequencies at which responses are computed, with what does not depend on the figures.

    Args:
        frequency: (L,) [Hz].
        clocking: of the drive.
    """

    def __init__(self, frequency: F64, clocking: Clocking) -> None:
        fold = np.arange(-_FOLDED, _FOLDED + 1) / clocking.period
        self.s: Any = 2j * math.pi * (frequency[:, None] + fold)
        tc = clocking.control_period
        ticks = round(clocking.period / tc)
        back = np.exp(-self.s * tc)
        self._back, self._tick = back, tc
        self.integral = tc * back / (1.0 - back)
        self.motor = (
            (1.0 - back)
            / (self.s * tc)
            / (1.0 + self.s / (2.0 * math.pi * clocking.current_bandwidth))
        )
        self.hold = _hold(back, ticks)

    @property
    def setpoint_hold(self) -> C128:
        """What ramp and ticks make of a row's target position, not folded, (L,)."""
        return self.hold[:, _FOLDED]

    def responses(self, figures: Figures, slides: bool) -> tuple[C128, C128]:
        """Responses to force offsets [m/N] and to target positions, (L,) each."""
        s = self.s
        plant = compliance(s, figures, slides) * self.motor * np.exp(-s * figures.dead_time)
        low_pass = self._tick / (figures.derivative_time + self._tick)
        slope = low_pass / self._tick * (1.0 - self._back) / (1.0 - (1.0 - low_pass) * self._back)
        law = figures.kp + figures.ki * self.integral + figures.kd * slope
        read = np.exp(-s * figures.age) / (1.0 + s * figures.smoothing)
        closed = plant / (1.0 + plant * law) * self.hold * read
        offset = figures.sign * closed * np.exp(-s * figures.lateness)
        return offset.sum(axis=1), (closed * law).sum(axis=1)


def compliance(s: C128, figures: Figures, slides: bool) -> C128:
    """Position by motor force at complex frequencies [m/N]."""
    stiffness, loss = (0.0, figures.viscous) if slides else (figures.stiffness, figures.loss)
    free = 1.0 / s**2
    for mode in figures.resonances:
        omega = 2.0 * math.pi * mode.frequency
        free = free + mode.share / (s**2 + 2.0 * mode.damping * omega * s + omega**2)
    free = free / figures.mass
    return free / (1.0 + free * (stiffness + loss * s))


def _hold(back: C128, ticks: int) -> C128:
    """One row's setpoint as the drive's ticks see it: ramped, a triangle."""
    up = np.arange(1, ticks + 1) / ticks
    powers = np.ones_like(back)
    total = np.zeros_like(back)
    for weight in np.concatenate((up, 1.0 - up)):
        total += weight * powers
        powers = powers * back
    return total / ticks
