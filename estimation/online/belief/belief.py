"""What is believed of an axis' friction between moves: mean and covariance, the next arrival cost.

Five figures relative to the start model (Coulomb force, viscous coefficient, presliding stiffness,
relaxation rate C/Fc, apparent mass), two absolute (alpha; lag of the force behind the position, in
sample periods), and the level: the Coulomb force of a real stage wanders by a stationary
Gauss-Markov factor 1 + w. The figures drift slowly from move to move; w decays with its correlation
time (`arrival_cost.age`).

The apparent mass is what the sampled force shows of the mass. The drive interpolates the setpoints
linearly between SYNCs, the ripple of force that this causes has a fixed phase to the sampling, so
the force sampled at SYNC differs from its mean by a constant times the acceleration (2.5 % of the
mass on the reference stage). It explains the force; the feedforward uses the true mass.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stagedata import F64, FrictionFigures

FIGURES = ("coulomb", "viscous", "stiffness", "relaxation_rate", "mass", "static_ratio", "lag")
COULOMB, VISCOUS, STIFFNESS, RATE, MASS, ALPHA, LAG = range(7)
FRICTION_FIGURES = ("coulomb", "viscous", "stiffness", "relaxation_rate", "static_ratio")
"""Those that belong to the friction law."""
SCATTERING = ("viscous", "stiffness", "relaxation_rate")
"""Those that differ from move to move where a stage is not as modelled (`scatter`)."""
LEVEL, FORCE = 7, 8
"""Places of w and of the unmodelled force d behind the figures."""
STATES = 9

# Unknowns of a solve behind the figures: offsets of the friction force [N] at rest before the move,
# behind the last turn, and when zone A begins; error of the first position [standard deviations],
# from which all travel is counted. The residual has a column between them and the level's knots.
REST_FORCE, TURN_FORCE, SLIP_FORCE, ORIGIN, RESIDUAL, KNOTS = range(LEVEL, LEVEL + 6)


@dataclass(frozen=True, slots=True)
class BeliefSettings:
    """How belief starts and ages; docs/reference/estimator.md says where the numbers come from.

    Attributes:
        start_spread: 1-sigma of each of `FIGURES` before the first move, in its unit: relative,
            but for the static ratio and the lag [sample periods].
        drift: 1-sigma by which each may change from move to move.
        wander: rms of the Gauss-Markov factor on the Coulomb force.
        correlation_time: of it [s].
        unmodelled: rms of the unmodelled force before the first move, relative to the Coulomb
            force; the moves then show how large it is. 0: there is none.
        variation: the same of the Coulomb force over place, beside its wander.
        scatter: the same of the figures of `SCATTERING` from move to move.
        unmodelled_length: correlation length of both [m].
    """

    start_spread: tuple[float, ...] = (0.6, 0.8, 0.8, 0.6, 0.05, 0.2, 0.5)
    drift: tuple[float, ...] = (0.002, 0.004, 0.005, 0.002, 0.0005, 0.002, 0.001)
    wander: float = 0.01
    correlation_time: float = 0.5
    unmodelled: float = 0.0
    variation: float = 0.0
    scatter: float = 0.0
    unmodelled_length: float = 5e-3

    @property
    def level(self) -> float:
        """Rms of w before the first move: wander and variation."""
        return math.hypot(self.wander, self.variation)


class Belief(NamedTuple):
    """Mean and covariance of the figures and the level; changed in place by an update.

    Attributes:
        mean: figures, w and d, shape (STATES,).
        covariance: of them, shape (STATES, STATES).
    """

    mean: F64
    covariance: F64

    @classmethod
    def at_start(cls, settings: BeliefSettings, friction: FrictionFigures) -> Belief:
        """Before any move; `friction` is what the figures are relative to."""
        spread = np.array([*settings.start_spread, settings.level, settings.unmodelled])
        mean = np.array([1.0, 1.0, 1.0, 1.0, 1.0, friction.static_ratio, 0.0, 0.0, 0.0])
        return cls(mean, np.diag(spread**2) + 1e-12 * np.eye(STATES))

    def set_apart(self, figure: int, value: float, sigma: float) -> None:
        """Set one state (figure, level or unmodelled force), independent of all others."""
        self.covariance[figure, :] = 0.0
        self.covariance[:, figure] = 0.0
        self.mean[figure] = value
        self.covariance[figure, figure] = sigma**2 + 1e-12


def model_at(start: FrictionFigures, mean: F64, level: float = 1.0) -> FrictionFigures:
    """The model with these figures, relative to those of `start`, the Coulomb force at `level`."""
    coulomb, viscous, stiffness, rate, _, alpha = mean[: ALPHA + 1].tolist()
    return FrictionFigures(
        start.elements,
        start.coulomb * coulomb * level,
        start.viscous * viscous,
        start.stiffness * stiffness,
        start.relaxation_rate * rate,
        alpha,
        start.stribeck_velocity,
        start.stribeck_shape,
        start.law,
    )
