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

from estimation.friction import F64, element_shares
from stagedata import FrictionFigures

FIGURES = (
    "coulomb", "viscous", "stiffness", "relaxation_rate", "mass", "static_ratio",
    "stribeck_velocity", "stribeck_shape", "asymmetry", "force_offset", "lag", "ripple_mass",
    "ripple_lag", "ripple_curve",
)  # fmt: skip
COULOMB, VISCOUS, STIFFNESS, RATE, MASS, ALPHA, VS, DELTA, ASYMMETRY, OFFSET, LAG = range(11)
RIPPLE = (11, 12, 13)
UNITS = ("N", "N s/m", "N/m", "1/s", "kg", "", "m/s", "", "", "N", "s", "", "", "")
FRICTION = (COULOMB, VISCOUS, STIFFNESS, RATE, ALPHA, VS, DELTA)
"""Those of the friction law that a machine file has."""
BASE = (COULOMB, VISCOUS, MASS, OFFSET, *RIPPLE)
"""Solved for first: the rest is not robust to these being wrong."""


@dataclass(frozen=True, slots=True)
class Prior:
    """Standard deviations of the machine file's figures before the first sample.

    Attributes:
        figures: relative, of Coulomb force, viscous coefficient, stiffness, relaxation rate and
            apparent mass.
        static_ratio: of alpha, absolute.
        stribeck_velocity: relative.  stribeck_shape: of delta, absolute.
        asymmetry: absolute; its mean is 0.
        force_offset: relative to the Coulomb force; its mean is 0.
        lag: of the force behind the position, in sample periods; its mean is 0.
        ripple: of the three ripple figures; their mean is 0.
        shape: relative, of every k_i and nu_i.
    """

    figures: tuple[float, float, float, float, float] = (0.4, 0.6, 0.6, 0.5, 0.1)
    static_ratio: float = 0.3
    stribeck_velocity: float = 0.7
    stribeck_shape: float = 0.4
    asymmetry: float = 0.15
    force_offset: float = 0.3
    lag: float = 0.2
    ripple: float = 0.2
    shape: float = 0.5


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


def unknowns(friction: FrictionFigures, mass: float, period: float, prior: Prior) -> Unknowns:
    """The unknowns of an axis.

    Args:
        friction: means of the prior, as the machine file has them.
        mass: moved mass, mean of the prior [kg].
        period: of the samples [s].
        prior: standard deviations.
    """
    count = friction.elements
    viscous = max(friction.viscous, 1e-3 * friction.coulomb)
    scale = np.array(
        [
            friction.coulomb, viscous, friction.stiffness, friction.relaxation_rate, mass, 1.0,
            friction.stribeck_velocity, 1.0, 1.0, friction.coulomb, period, 1.0, 1.0, 1.0,
        ]
    )  # fmt: skip
    mean = np.array(
        [
            1.0, friction.viscous / viscous, 1.0, 1.0, 1.0, friction.static_ratio, 1.0,
            friction.stribeck_shape, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        ]
    )  # fmt: skip
    spread = np.array(
        [
            *prior.figures, prior.static_ratio, prior.stribeck_velocity, prior.stribeck_shape,
            prior.asymmetry, prior.force_offset, prior.lag, *[prior.ripple] * 3,
        ]
    )  # fmt: skip
    lower = np.array([0.1, 0.0, 0.05, 0.05, 0.5, -0.9, 0.05, 0.3, -0.6, -1.0, -1.0, *[-1.0] * 3])
    upper = np.array([10.0, 20.0, 20.0, 20.0, 2.0, 5.0, 20.0, 4.0, 0.6, 1.0, 1.0, *[1.0] * 3])
    ones = np.ones(2 * count)
    numbers = range(1, count + 1)
    return Unknowns(
        (*FIGURES, *(f"k_{i}" for i in numbers), *(f"nu_{i}" for i in numbers)),
        (*UNITS, *("" for _ in ones)),
        np.concatenate([scale, ones]),
        np.concatenate([mean, ones]),
        np.concatenate([spread, prior.shape * ones]),
        np.concatenate([lower, 0.02 * ones]),
        np.concatenate([upper, 20.0 * ones]),
        np.full(count, 1.0 / count),
        element_shares(count),
    )


def chosen(count: int, which: tuple[int, ...]) -> NDArray[np.bool_]:
    """A mask of `count` unknowns, True at `which`."""
    mask = np.zeros(count, dtype=np.bool_)
    mask[list(which)] = True
    return mask
