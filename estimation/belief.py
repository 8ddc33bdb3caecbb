"""What is believed of an axis' friction between moves: the arrival cost of the next one.

Five figures relative to the model the axis started from (Coulomb force, viscous coefficient,
presliding stiffness, relaxation rate C/Fc, apparent mass) and the level: the Coulomb force of a
real stage wanders by itself, a stationary Gauss-Markov factor 1 + w. The figures drift slowly from
move to move; w is forgotten with its correlation time.

The apparent mass is what the sampled force shows of the mass. The drive interpolates the setpoints
linearly between SYNCs, the ripple of force that this causes has a fixed phase to the sampling, so
the force sampled at SYNC differs from its mean by a constant times the acceleration (2.5 % of the
mass on the reference stage). It explains the force; the feedforward uses the true mass.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from estimation.gms import F64, Friction

FIGURES = ("coulomb", "viscous", "stiffness", "relaxation_rate", "mass")
COULOMB, VISCOUS, STIFFNESS, RATE, MASS = range(5)
LEVEL = 5
"""Place of w behind the figures."""


@dataclass(frozen=True, slots=True)
class BeliefSettings:
    """How belief starts and ages.

    Attributes:
        start_spread: relative 1-sigma of each of `FIGURES` before the first move.
        drift: relative 1-sigma by which each may change from move to move.
        wander: rms of the Gauss-Markov factor on the Coulomb force.
        correlation_time: of it [s].
    """

    start_spread: tuple[float, float, float, float, float] = (0.6, 0.8, 0.8, 0.2, 0.05)
    drift: tuple[float, float, float, float, float] = (0.002, 0.004, 0.005, 0.002, 0.0005)
    wander: float = 0.01
    correlation_time: float = 0.5

    def wander_variance(self, elapsed: float) -> tuple[float, float]:
        """(factor kept, variance gained) of w over `elapsed` seconds."""
        keep = math.exp(-max(elapsed, 0.0) / self.correlation_time)
        return keep, (1.0 - keep**2) * self.wander**2 + 1e-12


@dataclass(frozen=True, slots=True)
class Belief:
    """Mean and covariance of the figures and the level.

    Attributes:
        mean: relative figures and w, shape (6,).
        covariance: of them, shape (6, 6).
    """

    mean: F64
    covariance: F64

    @classmethod
    def at_start(cls, settings: BeliefSettings) -> Belief:
        """Before any move."""
        variance = [s * s for s in (*settings.start_spread, settings.wander)]
        return cls(np.array([1.0] * len(FIGURES) + [0.0]), np.diag(variance) + 1e-12 * np.eye(6))

    def predicted(self, elapsed: float, settings: BeliefSettings) -> Belief:
        """The belief one move later, `elapsed` seconds on: drifted, the level half forgotten."""
        mean, covariance = self.mean.copy(), self.covariance.copy()
        keep, gained = settings.wander_variance(elapsed)
        mean[LEVEL] *= keep
        covariance[LEVEL, :] *= keep
        covariance[:, LEVEL] *= keep
        covariance[LEVEL, LEVEL] += gained
        covariance[range(LEVEL), range(LEVEL)] += np.square(settings.drift)
        return Belief(mean, covariance)

    def spread(self, figure: int) -> float:
        """Relative standard deviation of one figure."""
        return math.sqrt(float(self.covariance[figure, figure]))

    def friction(self, start: Friction) -> Friction:
        """The believed model; `start` is what the figures are relative to."""
        return model_at(start, self.mean)


def model_at(start: Friction, relative: F64) -> Friction:
    """The model whose figures are `relative` times those of `start`."""
    return replace(
        start,
        coulomb=start.coulomb * float(relative[COULOMB]),
        viscous=start.viscous * float(relative[VISCOUS]),
        stiffness=start.stiffness * float(relative[STIFFNESS]),
        relaxation_rate=start.relaxation_rate * float(relative[RATE]),
    )
