"""Unknowns of the off-line estimate, with priors and bounds.

Names are those of the machine file where it has the figure. Inside the fit every unknown is divided
by its scale, so that all of them are of order one.

Three unknowns belong to the drive, not to friction. The drive interpolates between setpoints, so
the demanded velocity has a step at every SYNC. The resulting force ripple has a fixed phase in the
samples and appears as a force: mass times the second difference of the setpoints one sample back,
its change and its curvature (`ripple_mass`, `ripple_lag`, `ripple_curve`). Where setpoints are not
known, measured positions replace them: then `mass` is the apparent one, and of the three only
`ripple_lag` is estimated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.friction import element_shares
from stagedata import F64, FrictionFigures

_FIGURES = (
    ("coulomb", "N", 0.4, 0.1, 10.0),
    ("viscous", "N s/m", 0.6, 0.0, 20.0),
    ("stiffness", "N/m", 0.6, 0.05, 20.0),
    ("relaxation_rate", "1/s", 0.5, 0.05, 20.0),
    ("mass", "kg", 0.1, 0.5, 2.0),
    ("static_ratio", "", 0.3, -0.9, 5.0),
    ("stribeck_velocity", "m/s", 0.7, 0.05, 20.0),
    ("stribeck_shape", "", 0.4, 0.3, 4.0),
    ("asymmetry", "", 0.15, -0.6, 0.6),
    ("force_offset", "N", 0.3, -1.0, 1.0),
    ("lag", "s", 0.2, -1.0, 1.0),
    ("ripple_mass", "", 0.2, -1.0, 1.0),
    ("ripple_lag", "", 0.2, -1.0, 1.0),
    ("ripple_curve", "", 0.2, -1.0, 1.0),
)
"""Name, unit; standard deviation before the first sample, lower and upper bound, in scales."""
_SHAPE = ("", 0.5, 0.02, 20.0)
"""The same of every factor on a k_i or nu_i."""
FIGURES = tuple(row[0] for row in _FIGURES)
COULOMB, VISCOUS, STIFFNESS, RATE, MASS, ALPHA, VS, DELTA, ASYMMETRY, OFFSET, LAG = range(11)
RIPPLE = (11, 12, 13)
FRICTION = (COULOMB, VISCOUS, STIFFNESS, RATE, ALPHA, VS, DELTA)
"""Those of the friction law that a machine file has."""
BASE = (COULOMB, VISCOUS, MASS, OFFSET, *RIPPLE)
"""Solved for first: the rest is not robust to these being wrong."""


@dataclass(frozen=True, slots=True)
class Unknowns:
    """All unknowns of one axis as vectors; the figures of `FIGURES`, then k_i, then nu_i factors.

    Attributes:
        names, units: of them.
        scale: of each in its unit, shape (n,).
        mean, spread: prior, in scales.  lower, upper: bounds, in scales.
        springs, shares: k_i and nu_i that the factors multiply, shape (N,).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    scale: F64
    mean: F64
    spread: F64
    lower: F64
    upper: F64
    springs: F64
    shares: F64

    @property
    def elements(self) -> int:
        """N."""
        return len(self.springs)

    def shape(self, q: F64) -> tuple[F64, F64]:
        """k_i and nu_i; each adds to one, whatever the factors."""
        count = self.elements
        springs = self.springs * q[-2 * count : -count]
        shares = self.shares * q[-count:]
        return springs / springs.sum(), shares / shares.sum()

    def values(self, q: F64) -> F64:
        """Everything in its unit: figures, k_i, nu_i, shape (n,)."""
        springs, shares = self.shape(q)
        return np.concatenate([(self.scale * q)[: len(FIGURES)], springs, shares])

    def slopes(self, q: F64) -> F64:
        """D values / d q, shape (n, n): the shares' factors act on all of them."""
        count, first = self.elements, len(FIGURES)
        result = np.diag(self.scale)
        for begin, base, now in zip(
            (first, first + count), (self.springs, self.shares), self.shape(q), strict=True
        ):
            total = float((base * q[begin : begin + count]).sum())
            block = (np.eye(count) - now[:, None]) * (base / total)[None, :]
            result[begin : begin + count, begin : begin + count] = block
        return result


def unknowns(friction: FrictionFigures, mass: float, period: float) -> Unknowns:
    """The unknowns of an axis.

    Args:
        friction: means of the prior, as the machine file has them.
        mass: moved mass, mean of the prior [kg].
        period: of the samples [s].
    """
    count = friction.elements
    viscous = max(friction.viscous, 1e-3 * friction.coulomb)
    scale = [
        friction.coulomb, viscous, friction.stiffness, friction.relaxation_rate, mass, 1.0,
        friction.stribeck_velocity, 1.0, 1.0, friction.coulomb, period, 1.0, 1.0, 1.0,
    ]  # fmt: skip
    mean = [
        1.0, friction.viscous / viscous, 1.0, 1.0, 1.0, friction.static_ratio, 1.0,
        friction.stribeck_shape, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ]  # fmt: skip
    ones, numbers = [1.0] * 2 * count, range(1, count + 1)
    rows = [row[1:] for row in _FIGURES] + [_SHAPE for _ in ones]
    units, spread, lower, upper = zip(*rows, strict=True)
    return Unknowns(
        (*FIGURES, *(f"k_{i}" for i in numbers), *(f"nu_{i}" for i in numbers)),
        units,
        np.array(scale + ones),
        np.array(mean + ones),
        np.array(spread),
        np.array(lower),
        np.array(upper),
        np.full(count, 1.0 / count),
        element_shares(count),
    )


def chosen(count: int, which: tuple[int, ...]) -> NDArray[np.bool_]:
    """A mask of `count` unknowns, True at `which`."""
    mask = np.zeros(count, dtype=np.bool_)
    mask[list(which)] = True
    return mask
