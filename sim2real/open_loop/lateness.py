"""How late a logged force is against the motion that it made, and whether it kept its sign.

Least squares over the force as it was some time later: mass, friction, and what is fitted beside it
as in `sim2real.open_loop.figures`. Friction may also depend on position, as that of a gear does on
the weight it carries: beside a force over position it would pass for a delay. The delay is the one
that leaves least. Low speeds are left out: what friction does there comes with the start and the
end of an acceleration and would pass for a delay. So would a resonance, but a delay is the same
below its frequency, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.special import eval_legendre

from hil_sim.settings import AxisSettings
from sim2real.open_loop.motion import AxisMotion, Motion, low_passed, smooth_over, spread
from stagedata import F64, AxisSignals, BoolArray

_SAMPLES, _SECONDS = 8, 0.05
"""Longest delay that is looked for, in samples or in seconds, whichever is longer."""
_STEP = 0.1
"""Distance of the delays tried, in periods of the cutoff."""
_FAST = 0.1
"""Share of the highest speed above which the force tells a delay."""
_LOWER = (1.0 / 4.0, 1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0)
"""Shares of the cutoff below which a delay has to be the same, as far as it shows there."""
_PARTS = 8
"""Parts of a recording, each left out once, that show how well a delay is known."""
_CERTAIN = 4.0
"""Standard deviations by which a delay must exceed what is usual."""
_ALIKE = 1.0 / 3.0
"""Part of a delay by which it may differ where it is well known, for other effects disturb it."""
_BETTER = 0.2
"""Least share of what is left that a delay must remove: a smaller one does little harm, and other
causes of it are likelier."""
_ROUNDS = 20
"""Most rounds in which the lost signs of a force are sought."""
_SIGNED = 0.25
"""A force has lost its sign where signs given by the model leave less than this share of the
energy."""
_BOTH = 0.02
"""A motion goes both ways where each takes at least this share of the usable samples."""


@dataclass(frozen=True, slots=True)
class Delay:
    """Delay of a force against the motion.

    Attributes:
        value: positive where the force is late [s].
        sigma: its standard deviation, by a jackknife [s].
        removed: share of what is left without it.
    """

    value: float
    sigma: float
    removed: float


def find_delay(motion: Motion, axis: AxisSettings) -> Delay | None:
    """The delay of the logged force of an axis that cannot be usual; None where there is none.

    A drive reports what it commands or what it measures, at the start or the end of a tick: one
    sample either way and the lag of the current loop are usual. Beyond that, a delay has to be
    certain, and the same in the lower parts of the band.

    Args:
        motion: of a recording.
        axis: settings; mass and friction are fitted, whatever they are.
    """
    cutoff = motion.axes[axis.name].cutoff
    usual = motion.period + 1.0 / (2.0 * math.pi * axis.control.current_bandwidth)
    delay = measure_delay(motion, axis, cutoff)
    if delay is None or delay.removed < _BETTER:
        return None
    if abs(delay.value) < usual + _CERTAIN * delay.sigma:
        return None
    lower = [measure_delay(motion, axis, share * cutoff) for share in _LOWER]
    if lower[0] is None:
        return None
    for slow in lower:
        if slow is not None:
            sigma = math.hypot(delay.sigma, slow.sigma)
            if abs(slow.value - delay.value) > max(_CERTAIN * sigma, _ALIKE * abs(delay.value)):
                return None
    return delay


def measure_delay(motion: Motion, axis: AxisSettings, cutoff: float) -> Delay | None:
    """The delay of a force below a frequency; None where the motion does not tell.

    Args:
        motion: of a recording.
        axis: settings.
        cutoff: that frequency [Hz].
    """
    moved = motion.axes[axis.name]
    speed = np.abs(moved.velocity)
    slow = speed < _FAST * float(speed.max())
    around = max(1, round(0.5 / cutoff / motion.period))
    usable = moved.usable & ~spread(slow | ~moved.usable, around)
    columns = _parts_of_force(moved, usable, axis.rotary, cutoff, motion.period)
    if len(columns) <= _PARTS * columns.shape[1]:
        return None
    at = np.flatnonzero(usable)
    force = low_passed(moved.logged, cutoff, motion.period)
    fit = _Fit(columns, at, force, motion.period)
    reach = max(_SAMPLES * motion.period, _SECONDS)
    steps = max(4, math.ceil(reach * cutoff / _STEP))
    grid = np.linspace(-reach, reach, 2 * steps + 1)
    least = int(np.argmin([fit.left(float(delay)) for delay in grid]))
    if least in (0, len(grid) - 1):
        return None
    step = float(grid[1] - grid[0])
    best = fit.near(float(grid[least]), step)
    if fit.mass(best) <= 0.0:
        return None
    each = [
        _Fit(np.delete(columns, part, axis=0), np.delete(at, part), force, motion.period)
        for part in np.array_split(np.arange(len(at)), _PARTS)
    ]
    sigma = float(np.std([part.near(best, step) for part in each])) * math.sqrt(_PARTS - 1)
    return Delay(best, sigma, 1.0 - fit.left(best) / max(fit.left(0.0), 1e-300))


class _Fit:
    """What a force, read later, leaves of a least-squares fit.

    Args:
        columns: of the fit, the mass first, float64[P, N].
        at: samples that they belong to, int[P].
        force: low-passed, float64[K] [N].
        period: of the samples [s].
    """

    def __init__(self, columns: F64, at: NDArray[np.intp], force: F64, period: float) -> None:
        self._size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-12)
        self._columns = columns / self._size
        self._basis = _basis(self._columns)
        self._at, self._end, self._period = at.astype(np.float64), len(force) - 1.0, period
        self._force = CubicSpline(np.arange(len(force)), force)

    def _later(self, delay: float) -> F64:
        at = np.clip(self._at + delay / self._period, 0.0, self._end)
        return np.asarray(self._force(at))

    def left(self, delay: float) -> float:
        """Squared and summed, of the force read later by `delay` [s], [N^2]."""
        force = self._later(delay)
        held = self._basis.T @ force
        return float(force @ force - held @ held)

    def mass(self, delay: float) -> float:
        """That the force read later by `delay` [s] goes with [kg]."""
        solved = np.linalg.lstsq(self._columns, self._later(delay), rcond=1e-9)[0]
        return float(solved[0] / self._size[0])

    def near(self, delay: float, step: float) -> float:
        """The delay that leaves least, up to a step from this one [s]."""
        found = minimize_scalar(
            self.left, bounds=(delay - step, delay + step), method="bounded",
            options={"xatol": 1e-3 * step},
        )  # fmt: skip
        return float(found.x)


def _parts_of_force(
    moved: AxisMotion, usable: BoolArray, rotary: bool, cutoff: float, period: float
) -> F64:
    """What the force is a sum of, the mass first, low-passed where usable, float64[P, N]."""
    velocity, sign = moved.velocity, np.sign(moved.velocity)
    when = np.linspace(-1.0, 1.0, len(velocity))
    parts = [moved.acceleration, sign, velocity, np.abs(velocity), velocity * np.abs(velocity)]
    smooth = smooth_over(moved.position, rotary)
    parts += [*smooth, *(sign * part for part in smooth[1:])]
    parts += [sign * eval_legendre(degree, when) for degree in (1, 2)]
    return low_passed(np.column_stack(parts), cutoff, period)[usable]


def _basis(columns: F64) -> F64:
    """An orthonormal basis of what columns span, float64[P, M]."""
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(basis[:, sizes > 1e-9 * sizes[0]])


def has_lost_sign(motion: Motion, axis: AxisSettings, logged: AxisSignals) -> bool:
    """Whether a force is the absolute value of the one that the motion took.

    It never changes its sign although the motion goes both ways, and a model that gives it signs
    leaves far less than one that takes it as it is. With a weight that is larger than all else a
    force has one sign, too, but gains nothing by others, for then it goes with acceleration.

    Args:
        motion: of a recording.
        axis: settings.
        logged: of the axis, as recorded.
    """
    force = logged.force_actual[logged.valid]
    moved = motion.axes[axis.name]
    if force.min() < 0.0 < force.max() or not moved.usable.any():
        return False
    ahead = float(np.mean(moved.velocity[moved.usable] > 0.0))
    if min(ahead, 1.0 - ahead) < _BOTH:
        return False
    columns = _parts_of_force(moved, moved.usable, axis.rotary, moved.cutoff, motion.period)
    basis = _basis(columns / np.maximum(np.abs(columns).max(axis=0), 1e-12))
    size, model = moved.force[moved.usable], moved.velocity[moved.usable]
    for _ in range(_ROUNDS):
        signs = np.sign(model)
        model = basis @ (basis.T @ (size * signs))
        if np.array_equal(np.sign(model), signs):
            break
    remaining = float(np.sum((size * np.sign(model) - model) ** 2))
    plain = size - basis @ (basis.T @ size)
    return remaining < _SIGNED * float(plain @ plain)
