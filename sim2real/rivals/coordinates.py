"""Coordinates of the motion that a force may depend on, and the columns that fit a curve over each.

A curve is linear between nodes. A force that changes sign with the direction is friction: it grows
after a reversal and at low speed as that of the machine file does. Over position it follows its
level with the time constant Fc/C, so at speed it lags. The path since the last reversal has a sum
of stop operators (Prandtl), each of which is proportional to the path up to its width; so has the
motor force since it last turned, where iron lags behind it (magnetic hysteresis). An encoder that
misreads over position seems to take what accelerates the mass along its error; one that lags behind
the path also what friction takes along the true one. What the library calls dynamics is a bank of
oscillators driven by the acceleration. A force over time that changes within a move predicts the
next one only as a wave, whose frequency may rise steadily.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import next_fast_len

from hil_sim.plant import force_variants
from hil_sim.settings import AxisSettings
from sim2real.filters import filtered
from sim2real.open_loop import Motion
from stagedata import F64, BoolArray
from stagedata.compiled import kernel

_PLACES, _NARROW = 2e-3, 2.5e-4
"""Distance of nodes over position [m]: at first, and a closer one that is tried."""
_MOST_PLACES = 800
_MICROMETRE = 1e-6
"""Unit of the heights of a misreading [m]: some newtons at speed, as other curves have them."""
_SPEEDS = (0.01, 0.03, 0.07, 0.15, 0.3, 0.5, 0.75, 1.0)
_CLOSER = (
    0.005, 0.01, 0.02, 0.035, 0.055, 0.08, 0.11, 0.15, 0.2, 0.26, 0.33, 0.42, 0.52, 0.65, 0.8, 1.0,
)  # fmt: skip
"""Nodes over velocity, acceleration and force on each side of zero, in shares of the largest, and
closer ones that are tried."""
_SPEED = ("velocity", "force", "acceleration")
_OTHER_SIDE = 1e-3
"""Least reach of the nodes on one side of zero, as a share of that on the other."""
_PATHS = (2e-5, 1e-4, 4e-4, 1.5e-3, 5e-3, 1.5e-2, 5e-2)
"""Widths of stop operators [m]."""
_LASH = (2e-7, 1e-6, 4e-6, 1e-5, 2e-5, 4e-5, 1e-4)
"""The same of what an encoder reads too much [m]: play of its mount is far smaller."""
_LOOPS = (0.01, 0.02, 0.04, 0.07, 0.11, 0.17, 0.25, 0.37, 0.55, 0.8, 2.0)
"""The same over motor force, in shares of the largest."""
_TIMES, _SPAN = 24, 0.25
"""Most nodes over time, and their smallest distance [s]."""
_WAVES, _WAVES_OF_FRICTION = 120.0, 20.0
"""Highest frequency of a force over time that is a wave, and of friction over time [Hz]."""
_RISE, _RATES = 8.0, 500
"""Fastest rise or fall of a force's frequency [Hz/s], and rates that are tried of each."""
_PADDED, _FINE = 4, 5
"""Lines of the search for a wave per line of the spectrum, and tries between lines."""
_HARMONICS = 2
_MOST_SAMPLES = 100_000
"""Samples up to which waves are sought: their phase has to hold throughout."""
_DRAWN, _MOST_DRAWN = 16, 4000
"""Points of a wave's curve per period, and at most."""
_FREQUENCIES, _DAMPING = (4.0, 6.0, 9.0, 13.0, 20.0, 30.0, 45.0, 68.0, 100.0), 0.1
"""Oscillators of the bank [Hz] and their damping ratio."""
_SLIDING = 1e-4
"""Velocity from which friction follows its level [m/s]."""


@dataclass(frozen=True, slots=True)
class Coordinate:
    """What a force depends on.

    Attributes:
        over: as `unlisted` of a report calls it.
        along: quantity of the motion that the nodes are of.
        times: what the curve is multiplied by: "" for nothing, "friction" for the friction that a
            Coulomb force of 1 N makes, "force" for the motor force over its rms; "history" where
            it is no curve, but depends on where the quantity last turned; "reading" where it is no
            force, but what an encoder reads too much.
        step: between nodes over position [m].
        close: whether nodes over velocity, acceleration and force are the closer ones.
    """

    over: str
    along: str
    times: str = ""
    step: float = _PLACES
    close: bool = False

    @property
    def is_curve(self) -> bool:
        """Whether neighbouring heights belong together; else each column stands for itself."""
        along = (*_SPEED, "position", "other_position", "time")
        return self.along in along and self.times != "history"

    @property
    def may_repeat(self) -> bool:
        """Whether a curve may go on beyond the recorded places, as of magnets and screws."""
        return self.along == "position" and self.times != "reading"

    @property
    def is_held(self) -> bool:
        """Whether a curve shows by its bends only, as an encoder's error does."""
        return self.times == "reading" and self.is_curve

    @property
    def is_narrow(self) -> bool:
        """Whether most of the nodes over position lie where nothing bends the curve."""
        return self.step < 2.0 * _NARROW


COORDINATES = (
    Coordinate("velocity", "velocity"),
    Coordinate("position", "position"),
    Coordinate("position_direction", "position", "friction"),
    Coordinate("position", "position", "force"),
    Coordinate("position", "position", "reading"),
    Coordinate("reversal_path", "path"),
    Coordinate("reversal_path", "path", "reading"),
    Coordinate("force", "force"),
    Coordinate("force", "force", "friction"),
    Coordinate("force", "force", "history"),
    Coordinate("acceleration", "acceleration"),
    Coordinate("acceleration", "acceleration", "friction"),
    Coordinate("time", "time"),
    Coordinate("time", "time", "friction"),
    Coordinate("other_axis", "other_position"),
    Coordinate("other_axis", "other_position", "friction"),
    Coordinate("other_axis", "other_motion"),
    Coordinate("frequency", "oscillators"),
)
WAVES = (Coordinate("time", "wave"), Coordinate("time", "wave", "friction"))
"""Forces over time that change within a move: a later one shows them only if they repeat."""
NARROW = tuple(replace(each, step=_NARROW) for each in COORDINATES if each.along == "position")
CLOSER = tuple(Coordinate(over, over, close=True) for over in _SPEED)
"""With closer nodes than among `COORDINATES`."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What one axis does in one recording of P samples.

    Attributes:
        quantities: by name, float64[P]: position [m], velocity, acceleration, force [N], time [s],
            friction (of a Coulomb force of 1 N) [N].
        other: velocity and acceleration of the other axis, float64[P, 2]; None where there is none.
        relaxed: share of the friction's level that is kept from one sample to the next.
        period: of the samples [s].
        axis: by the machine file, without effects.
        force_rms: of the motor force in all recordings [N].
    """

    quantities: dict[str, F64]
    other: F64 | None
    relaxed: float
    period: float
    axis: AxisSettings
    force_rms: float


def courses(
    axis: AxisSettings, motions: Sequence[Motion], forces: Sequence[tuple[F64, F64]]
) -> list[Course]:
    """The courses of an axis in all recordings.

    Args:
        axis: by the machine file.
        motions: of the recordings.
        forces: that these take by the machine file, and what a Coulomb force of 1 N adds to them,
            float64[P] each [N]. Not as measured: over its own noise any force is a curve.
    """
    rms = max(float(np.std(np.concatenate([force for force, _ in forces]))), 1e-12)
    found = []
    for motion, (force, friction) in zip(motions, forces, strict=True):
        own = motion.axes[axis.name]
        others = [moved for other, moved in motion.axes.items() if other != axis.name]
        quantities: dict[str, F64] = {
            "position": own.position,
            "velocity": own.velocity,
            "acceleration": own.acceleration,
            "force": force,
            "friction": friction,
            "time": motion.start + motion.period * np.arange(float(len(own.position))),
        }
        other = None
        if len(others) == 1:
            other = np.column_stack((others[0].velocity, others[0].acceleration))
            quantities["other_position"] = others[0].position
        kept = math.exp(-axis.friction.relaxation_rate * motion.period)
        plain = replace(axis, effects=())
        found.append(Course(quantities, other, kept, motion.period, plain, rms))
    return found


def nodes(coordinate: Coordinate, found: Sequence[Course]) -> F64 | None:
    """Nodes of a curve, float64[n]; None where the recordings do not cover the coordinate."""
    if coordinate.along == "path":
        return np.array(_LASH if coordinate.times else _PATHS)
    if coordinate.along == "oscillators":
        top = 0.2 / found[0].period
        below = [f for f in _FREQUENCIES if f < top]
        return np.array(below) if below else None
    if coordinate.along == "other_motion":
        return None if found[0].other is None else np.arange(2.0)
    if coordinate.along not in found[0].quantities:
        return None
    values = [course.quantities[coordinate.along] for course in found]
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    if not high > low:
        return None
    if coordinate.along == "time":
        return np.linspace(low, high, max(3, min(_TIMES, round((high - low) / _SPAN))))
    if coordinate.along in ("position", "other_position"):
        count = round((high - low) / coordinate.step) + 1
        return np.linspace(low, high, min(max(4, count), _MOST_PLACES))
    if coordinate.times == "history":
        return max(-low, high) * np.array(_LOOPS)
    # Nodes differ from each other on a side that nothing reaches, too.
    low, high = min(low, -_OTHER_SIDE * high), max(high, -_OTHER_SIDE * low)
    side = np.array(_CLOSER if coordinate.close else _SPEEDS)
    return np.concatenate((low * side[::-1], [0.0], high * side))


def columns(coordinate: Coordinate, at: F64, course: Course) -> F64:
    """The force of a curve of unit height at each node, not low-passed, float64[P, n]."""
    if coordinate.along == "path":
        over = stop_operators(course.quantities["position"], at)
        return _lagging(over, course) if coordinate.times else over
    if coordinate.times == "history":
        return stop_operators(course.quantities[coordinate.along], at)
    if coordinate.along == "oscillators":
        return _oscillations(course.quantities["acceleration"], at, course.period)
    if coordinate.along == "other_motion" and course.other is not None:
        return course.other
    if coordinate.times == "reading":
        over = _splines(course.quantities[coordinate.along], at)
        bent = np.diff(over, 2, axis=0, prepend=over[:1], append=over[-1:])
        return -course.axis.mass * _MICROMETRE / course.period**2 * bent
    if coordinate.along == "wave":
        over = _waves(course.quantities["time"], at)
    else:
        over = _hats(course.quantities[coordinate.along], at)
    if coordinate.along in _SPEED:
        over = np.delete(over, len(at) // 2, axis=1)  # 0 at 0: that is a constant force
    if coordinate.times == "friction":
        velocity, friction = course.quantities["velocity"], course.quantities["friction"]
        over = friction[:, None] * _lagged(over, velocity, course.relaxed)
    elif coordinate.times == "force":
        over = over * (course.quantities["force"] / course.force_rms)[:, None]
    return over


def as_curve(
    coordinate: Coordinate, at: F64, heights: F64, sigma: F64
) -> tuple[Coordinate, F64, F64, F64]:
    """Coordinate, nodes, force there and its sigma, of what the columns were fitted with.

    Of a misreading, what is read too much there [m].

    Args:
        coordinate: of the columns.
        at: as `nodes`.
        heights: of the columns, float64[n] [N].
        sigma: of the heights, float64[n] [N].
    """
    if coordinate.times == "reading":
        if coordinate.along == "path":
            plain = replace(coordinate, times="")
            _, path, error, spread = as_curve(plain, at, heights, sigma)
            return coordinate, path, _MICROMETRE * error, _MICROMETRE * spread
        over = _MICROMETRE * _splines(at, at)
        return coordinate, at, over @ heights, np.sqrt(over**2 @ sigma**2)
    if coordinate.along == "path" or coordinate.times == "history":  # after a reversal
        path = np.append(0.0, 2.0 * at)
        share = np.clip(path[:, None] / at - 1.0, -1.0, 1.0)
        return coordinate, path, share @ heights, np.sqrt(share**2 @ sigma**2)
    if coordinate.along == "wave":
        low, high, frequency, rate = at
        cycles = (high - low) * (frequency + 0.5 * abs(rate) * (high - low))
        times = np.linspace(low, high, int(min(_DRAWN * cycles + _DRAWN, _MOST_DRAWN)))
        over = _waves(times, at)
        return coordinate, times, over @ heights, np.sqrt(over**2 @ sigma**2)
    if coordinate.along == "oscillators":  # deflection and rate together
        both = heights.reshape(-1, 2), sigma.reshape(-1, 2)
        return coordinate, at, *(np.hypot(*part.T) for part in both)
    if len(heights) < len(at):
        middle = len(at) // 2
        heights, sigma = np.insert(heights, middle, 0.0), np.insert(sigma, middle, 0.0)
    if (
        coordinate.over == "force" and not coordinate.times
    ):  # what is missing is part of the measured force
        return coordinate, at + heights, heights, sigma
    return coordinate, at, heights, sigma


def find_wave(
    coordinate: Coordinate,
    found: Sequence[Course],
    used: Sequence[BoolArray],
    force: F64,
    period: float,
) -> F64 | None:
    """Start and end [s], frequency [Hz] and its rise [Hz/s] of the wave that takes most of a force.

    A linear rise is taken out first (dechirping), then the highest line of the spectrum counts.

    Args:
        coordinate: over time, as one of `WAVES`.
        found: courses of all recordings.
        used: samples in them that have a force, bool[P] each.
        force: at these, float64[R] [N].
        period: of these [s].

    Returns:
        float64[4]; None where the samples are too slow.
    """
    times = np.concatenate([c.quantities["time"][own] for c, own in zip(found, used, strict=True)])
    low, high = float(times.min()), float(times.max())
    extent = high - low
    top = min(_WAVES_OF_FRICTION if coordinate.times else _WAVES, 0.2 / period)
    count = round(extent / period) + 1
    if top * extent < _PADDED or count > _MOST_SAMPLES:
        return None
    if coordinate.times:
        level = [c.quantities["friction"][own] for c, own in zip(found, used, strict=True)]
        force = force * np.concatenate(level)
    series = np.zeros(count)
    np.add.at(series, np.round((times - low) / period).astype(np.int64), force)
    clock = period * np.arange(count)
    step = 2.0 / extent**2
    most = 0 if coordinate.times else min(_RATES, int(_RISE / step))
    length = next_fast_len(_PADDED * count)
    lines = round(top * length * period)

    def power(rate: float) -> F64:
        turned = series * np.exp(-1j * math.pi * rate * clock**2) if rate else series
        spectrum = np.fft.fft(turned, length)
        return np.asarray(np.abs(spectrum[_PADDED : lines + 1]))

    rates = step * np.arange(-most, most + 1)
    highest = np.array([power(rate).max() for rate in rates])
    rate = float(rates[highest.argmax()])
    frequency = (_PADDED + int(power(rate).argmax())) / (length * period)
    tries = np.linspace(-1.0, 1.0, 2 * _FINE + 1)

    def at(frequency: float, rate: float) -> float:
        angle = 2.0 * math.pi * (frequency * clock + 0.5 * rate * clock**2)
        return float(np.hypot(series @ np.cos(angle), series @ np.sin(angle)))

    near = [
        (frequency + f / (_PADDED * extent), rate + (r * step if most else 0.0))
        for f in tries
        for r in (tries if most else (0.0,))
    ]
    frequency, rate = max(near, key=lambda each: at(*each))
    return np.array([low, high, frequency, rate])


def _waves(times: F64, at: F64) -> F64:
    """Sine and cosine of a wave and of its harmonics, float64[P, 2 `_HARMONICS`]."""
    low, _, frequency, rate = at
    since = times - low
    angle = 2.0 * math.pi * (frequency * since + 0.5 * rate * since**2)
    order = angle[:, None] * np.arange(1.0, _HARMONICS + 1.0)
    return np.column_stack((np.sin(order), np.cos(order)))


def _lagging(over: F64, course: Course) -> F64:
    """The force that readings too large by so many micrometres seem to take, float64[P, n] [N].

    Near a reversal the true position counts for friction, too.
    """
    read = course.quantities["position"][:, None]
    true = read - _MICROMETRE * np.column_stack((np.zeros(len(over)), over))
    velocity = np.gradient(true, course.period, axis=0)
    acceleration = np.zeros_like(true)
    acceleration[1:-1] = np.diff(true, 2, axis=0) / course.period**2
    variants = [course.axis] * true.shape[1]
    force = force_variants(course.period, variants, (true, velocity, acceleration))
    return np.asarray(force[:, 1:] - force[:, :1])


def _hats(values: F64, at: F64) -> F64:
    """Hat functions of increasing nodes, 1 beyond the ends, float64[P, n]."""
    cell = np.clip(np.searchsorted(at, values) - 1, 0, len(at) - 2)
    share = np.clip((values - at[cell]) / (at[cell + 1] - at[cell]), 0.0, 1.0)
    hats = np.zeros((len(values), len(at)))
    rows = np.arange(len(values))
    hats[rows, cell] = 1.0 - share
    hats[rows, cell + 1] = share
    return hats


def _splines(values: F64, at: F64) -> F64:
    """Cubic B-splines around equidistant nodes, float64[P, n]."""
    step = at[1] - at[0]
    cell = np.clip(np.searchsorted(at, values) - 1, 0, len(at) - 2)
    u = (values - at[cell]) / step
    over = np.zeros((len(values), len(at) + 2))
    rows = np.arange(len(values))
    for away, x in enumerate((1.0 + u, u, 1.0 - u, 2.0 - u)):
        near = 2.0 / 3.0 - x**2 + x**3 / 2.0
        over[rows, cell + away] = np.where(x < 1.0, near, (2.0 - x) ** 3 / 6.0)
    return over[:, 1:-1]


def _lagged(hats: F64, velocity: F64, kept: float) -> F64:
    """Hat functions delayed as sliding friction follows its level; not delayed at rest."""
    sliding = np.abs(velocity) > _SLIDING
    if sliding.any():
        moved = hats[sliding]
        hats[sliding] = moved[0] + filtered([1.0 - kept], [1.0, -kept], (moved - moved[0]).T).T
    return hats


def stop_operators(position: F64, widths: F64) -> F64:
    """Stop operators (Prandtl): the travel over the width, held at -1 and 1 until it reverses.

    Args:
        position: float64[T] [m], or a force [N].
        widths: travel from the middle until they slide, float64[K] in the same unit.

    Returns:
        float64[T, K], -1..1; 0 at first.
    """
    return np.asarray(_run_stop_operators(np.ascontiguousarray(position), widths))


@kernel(error_model="python")
def _run_stop_operators(position: F64, widths: F64) -> F64:
    """Stop operators float64[T, K] of positions float64[T] [m] and widths float64[K] [m]."""
    out = np.zeros((len(position), len(widths)))
    for t in range(1, len(position)):
        moved = position[t] - position[t - 1]
        for k in range(len(widths)):
            out[t, k] = min(max(out[t - 1, k] + moved / widths[k], -1.0), 1.0)
    return out


def _oscillations(acceleration: F64, frequencies: F64, period: float) -> F64:
    """Deflection and rate of oscillators driven by an acceleration, float64[P, 2 n]."""
    out = []
    for frequency in frequencies:
        angle = 2.0 * math.pi * frequency * period
        radius = math.exp(-_DAMPING * angle)
        poles = [1.0, -2.0 * radius * math.cos(angle), radius**2]
        for zeros in ([1.0], [1.0, -1.0]):
            driven = filtered(zeros, poles, acceleration)
            out.append(driven / max(float(np.std(driven)), 1e-12))
    return np.column_stack(out)
