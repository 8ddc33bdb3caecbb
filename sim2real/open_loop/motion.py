"""The motion of a recording: position, velocity and acceleration, and the force that it took.

Positions are differentiated twice, which amplifies their noise with the square of frequency. So
they are low-passed (forward and backward, without delay), and the forces of recording and model an
octave lower, alike. The cutoff is the highest at which the noise of mass times acceleration stays
below that of the force itself, or below a hundredth of the force, and that of the acceleration
below a tenth of it: a mass found by least squares is too small by the square of that share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hil_sim.settings import AxisSettings, StageSettings
from sim2real.gap import match_periods, quantisation_step
from sim2real.phases import split_phases
from stagedata import F64, AxisSignals, BoolArray, Move, Recording

_SLOWEST, _FASTEST = 0.5, 0.2
"""Lowest cutoff of the force [Hz], and the highest over the sample rate."""
_ENOUGH = 0.01
"""Noise of mass times acceleration that is always accepted, as a share of the rms force."""
_PART = 0.1
"""Largest noise of the acceleration, as a share of its rms below the cutoff."""
_ORDER = 3
"""Of the low-pass, which runs forward and backward."""
_STILL, _SIGMAS = 0.003, 4.0
"""An axis moves above this share of its highest speed, and above the noise of its velocity."""
_AROUND = 0.5
"""Time around rests and gaps that is left out, in periods of the cutoff: at rest friction may have
any force within its limits, and the low-pass spreads it. A shorter standstill is a reversal."""
_BAND = 0.5
"""Share of the cutoff above which what a model leaves counts as noise."""
_POWERS = (0, 1, 2, 3)
"""Powers of position in a smooth force over it."""
_SHORT = 0.01
"""Share of the travelled length below which a stroke belongs to the one before."""


@dataclass(frozen=True, slots=True, eq=False)
class AxisMotion:
    """The motion of one axis over P sample periods.

    Attributes:
        position, velocity, acceleration: smooth, float64[P] [m, m/s, m/s^2].
        force: low-passed, float64[P] [N].
        logged: force as logged, float64[P] [N].
        usable: bool[P], the axis moves and nothing is missing nearby.
        cutoff: of the forces [Hz].
        noise: of the low-passed force and of mass times acceleration together, rms [N]; an upper
            limit, since forces of the controller at high frequencies count as noise here.
        shows_acceleration: whether noise and steps of the position leave the acceleration below the
            cutoff.
    """

    position: F64
    velocity: F64
    acceleration: F64
    force: F64
    logged: F64
    usable: BoolArray
    cutoff: float
    noise: float
    shows_acceleration: bool


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion of all axes of a recording.

    Attributes:
        period: of the samples [s].
        axes: name -> motion; of every axis of the machine file.
        recording: the same as a recording, without gaps: smooth positions are demand and actual
            value (the demand stands still with the axis), a move is a stroke of the axis that
            travels farthest.
        start: of the recording, on the clock of effects that fade with time [s].
    """

    period: float
    axes: Mapping[str, AxisMotion]
    recording: Recording
    start: float = 0.0

    def low_pass(self, axis: str, force: F64) -> F64:
        """Forces as that of this axis was low-passed, float64[P] or float64[P, n] [N]."""
        return low_passed(force, self.axes[axis].cutoff, self.period)

    def noise_of(self, axis: str, force: F64) -> float:
        """Noise of the low-passed force, estimated from what a model leaves, rms [N].

        It is taken from the octave below the cutoff, where the plant's forces are small and those
        of a fast controller go into acceleration, which the model has; at most `AxisMotion.noise`.

        Args:
            axis: its name.
            force: of the model, not low-passed, float64[P] [N].
        """
        own = self.axes[axis]
        if not own.usable.any():
            return own.noise
        left = own.logged - force
        low = _BAND * own.cutoff
        high = low_passed(left, own.cutoff, self.period) - low_passed(left, low, self.period)
        deviation = 1.4826 * float(np.median(np.abs(high[own.usable])))
        return min(own.noise, deviation / math.sqrt(1.0 - _BAND))


def measure_motion(recording: Recording, settings: StageSettings) -> Motion:
    """The motion of a recording.

    Args:
        recording: samples one SYNC period apart, or with holes.
        settings: of the machine file.

    Raises:
        ValueError: an axis of the machine file is missing or has too few valid samples, or the
            samples are not one SYNC period apart.
    """
    period = settings.sync_period
    place = match_periods(recording.time, period)
    grid = np.arange(place[-1] + 1)
    axes: dict[str, AxisMotion] = {}
    signals: dict[str, AxisSignals] = {}
    for axis in settings.axes:
        if axis.name not in recording.axes:
            raise ValueError(f"axis {axis.name}: not in the recording")
        logged = recording.axes[axis.name]
        if logged.valid.sum() < 10 * _ORDER:
            raise ValueError(f"axis {axis.name}: {logged.valid.sum()} valid samples")
        at = place[logged.valid]
        known = np.zeros(len(grid), dtype=np.bool_)
        known[at] = True
        position = np.interp(grid, at, logged.position_actual[logged.valid])
        force = np.interp(grid, at, logged.force_actual[logged.valid])
        axes[axis.name] = moved = _smoothed(position, force, known, axis, period)
        signals[axis.name] = AxisSignals(
            _standing(moved),
            np.zeros(len(grid)),
            moved.position,
            moved.force,
            None,
            moved.usable,
        )
    time = np.asarray(grid * period, dtype=np.float64)
    moves = _strokes({name: s.position_demand for name, s in signals.items()}, period)
    smooth = Recording(recording.machine, "", "", time, signals, moves, recording.source)
    return Motion(period, axes, smooth, settings.start)


def _smoothed(
    position: F64, force: F64, known: BoolArray, axis: AxisSettings, period: float
) -> AxisMotion:
    """The motion of one axis; `known`, bool[P], where there are samples."""
    cutoff, noise, jitter = _choose_cutoff(position, force, axis.mass, period)
    smooth = low_passed(position, 2.0 * cutoff, period)
    velocity = np.gradient(smooth, period)
    acceleration = np.zeros_like(smooth)
    acceleration[1:-1] = np.diff(smooth, 2) / period**2
    around = max(1, round(_AROUND / cutoff / period))
    speed = np.abs(velocity)
    moving = speed > max(_STILL * float(speed.max()), _SIGMAS * jitter)
    at_rest = ~spread(moving, around)
    unknown = ~known | spread(at_rest, around)
    unknown[0] = unknown[-1] = True  # filters know nothing beyond the ends
    usable = ~spread(unknown, around)
    low = low_passed(force, cutoff, period)
    shown = _shows_acceleration(position, cutoff, period)
    return AxisMotion(smooth, velocity, acceleration, low, force, usable, cutoff, noise, shown)


def _choose_cutoff(
    position: F64, force: F64, mass: float, period: float
) -> tuple[float, float, float]:
    """Cutoff of the forces [Hz], their noise then [N rms], and that of the velocity [m/s rms]."""
    of_position, of_force = _white_noise(position), _white_noise(force)
    rate = 2.0 * math.pi
    highest = _FASTEST / period
    frequencies = np.geomspace(min(_SLOWEST, highest), highest, 60)
    # One-sided densities: 2 sigma^2 times the period.
    accelerating = mass * of_position * np.sqrt(2.0 * period * rate**4 * frequencies**5 / 5.0)
    own = of_force * np.sqrt(2.0 * period * frequencies)
    allowed = np.maximum(own, _ENOUGH * float(np.std(force)))
    inertial = mass * _acceleration_below(frequencies, position, period)
    allowed = np.minimum(allowed, _PART * inertial)
    best = int(np.flatnonzero(accelerating <= allowed)[-1:].sum())
    cutoff = float(frequencies[best])
    noise = float(np.hypot(accelerating[best], own[best]))
    jitter = of_position * math.sqrt(2.0 * period * rate**2 * (2.0 * cutoff) ** 3 / 3.0)
    return cutoff, noise, jitter


def _shows_acceleration(position: F64, cutoff: float, period: float) -> bool:
    """Whether the noise of the acceleration up to the cutoff [Hz] is as small as it should be.

    Of coarse positions that are sampled slowly no part is white: their steps count, too.
    """
    step = quantisation_step(position) or 0.0
    sigma = max(_white_noise(position), step / math.sqrt(12.0))
    noise = sigma * math.sqrt(2.0 * period * (2.0 * math.pi) ** 4 * cutoff**5 / 5.0)
    return bool(noise <= _PART * _acceleration_below(np.array([cutoff]), position, period)[0])


def _acceleration_below(frequencies: F64, position: F64, period: float) -> F64:
    """Acceleration up to each frequency [Hz], rms, its noise included, float64[F] [m/s^2]."""
    power = np.abs(np.fft.rfft(np.diff(position, 2) / period**2)) ** 2
    count = len(position) - 2
    cumulated = 2.0 * np.cumsum(power) / count**2
    return np.asarray(np.sqrt(np.interp(frequencies, np.fft.rfftfreq(count, period), cumulated)))


def _white_noise(values: F64) -> float:
    """Rms of the white part of a signal, from the highest frequencies of its second difference."""
    from scipy.signal import welch  # slow to import; most diagnoses need no motion

    size = min(512, len(values) - 2)
    frequencies, density = welch(np.diff(values, 2), nperseg=size)
    top = frequencies > 0.35
    if not top.any():
        return 0.0
    response = (2.0 * np.sin(np.pi * frequencies[top])) ** 4
    return float(np.sqrt(0.5 * np.median(density[top] / response)))


def low_passed(values: F64, cutoff: float, period: float) -> F64:
    """Values without what is faster than a cutoff [Hz], not delayed; period in s.

    Shaped as the values, float64[P] or float64[P, n].
    """
    from scipy.signal import butter, sosfiltfilt

    share = 2.0 * cutoff * period
    sections = butter(_ORDER, min(share, 0.9), output="sos")
    pad = min(len(values) - 1, round(3.0 / share) + 3 * _ORDER)
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=pad))


def smooth_over(position: F64, rotary: bool, reach: float | None = None) -> list[F64]:
    """What a smooth force over position is a sum of, float64[P] each.

    Springs and a weight are powers; the weight of an arm goes with sine and cosine of its angle,
    which no power follows over a turn.

    Args:
        position: float64[P] [m].
        rotary: whether the axis turns.
        reach: largest distance from 0 [m]; that of the position where not given.
    """
    size = float(np.abs(position).max(initial=0.0)) if reach is None else reach
    parts = [(position / max(size, 1e-12)) ** power for power in _POWERS]
    return [*parts, np.sin(position), np.cos(position)] if rotary else parts


def spread(flags: BoolArray, reach: int) -> BoolArray:
    """Flags, and the samples up to `reach` away from one."""
    sums = np.concatenate(([0], np.cumsum(flags)))
    at = np.arange(len(flags))
    last = sums[np.minimum(at + reach + 1, len(flags))]
    return np.asarray(last > sums[np.maximum(at - reach, 0)])


def _standing(moved: AxisMotion) -> F64:
    """The position where samples are usable, held at its last value elsewhere, float64[P] [m]."""
    latest = np.where(moved.usable, np.arange(len(moved.usable)), 0)
    return np.asarray(moved.position[np.maximum.accumulate(latest)])


def _strokes(demands: Mapping[str, F64], period: float) -> tuple[Move, ...]:
    """The strokes of the axis that travels farthest, as moves."""
    farthest = max(demands, key=lambda name: float(np.abs(np.diff(demands[name])).sum()))
    strokes = split_phases(demands[farthest], period).strokes
    least = _SHORT * float(np.ptp(demands[farthest]))
    starts = [s.start for s in strokes if s.length > least]
    ends = [*starts[1:], len(demands[farthest])]
    return tuple(
        Move(
            "other",
            start,
            end,
            {name: float(d[max(start - 1, 0)]) for name, d in demands.items()},
            {name: float(d[end - 1]) for name, d in demands.items()},
        )
        for start, end in zip(starts, ends, strict=True)
    )
