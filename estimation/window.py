"""One move as a bounded least-squares problem with an arrival cost.

The residual is measured force minus friction model minus apparent mass times acceleration, the
model driven by the measured positions from the friction state at rest before the move. Inside the
move the level w is an unknown at a few knots, joined by its Gauss-Markov process, so that the
wander of a real stage is modelled and not averaged into the figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.belief import LEVEL, Belief, BeliefSettings, model_at
from estimation.gms import F64, Friction, FrictionState, follow
from estimation.kinematics import Kinematics
from estimation.least_squares import solve

KNOT_SPACING = 0.1
"""Of the level's knots [s]: a fifth of its usual correlation time."""
LEVEL_BOUND = 0.2
SUBSTEPS = 4
"""Of the friction model inside a sample."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Outcome for one zone.

    Attributes:
        belief: after it; the level is that at the end of the move.
        misfit: rms of the whitened residual.
        at_bound: figures that lie on a bound.
        evaluations: of the model.
    """

    belief: Belief
    misfit: float
    at_bound: tuple[int, ...]
    evaluations: int


class MoveWindow:
    """The samples of one move and what is needed to predict their force.

    Args:
        start: model that all figures are relative to.
        state: friction state at rest before the move, under `known`.
        known: model in force before the move.
        motion: of the move, shape (K,).
        force: measured, shape (K,) [N].
        origin: position at rest before the move [m].
        rest_force: force measured there [N].
        mass: moved mass [kg].
        noise: rms of force minus mass times acceleration, from the sensors [N].
        model_error: rms of what the model misses, relative to the Coulomb force.
        period: of the samples [s].
        settings: of the belief.
    """

    def __init__(
        self,
        start: Friction,
        state: FrictionState,
        known: Friction,
        motion: Kinematics,
        force: F64,
        origin: float,
        rest_force: float,
        mass: float,
        noise: float,
        model_error: float,
        period: float,
        settings: BeliefSettings,
    ) -> None:
        self._start, self._state, self._known = start, state, known
        self._motion, self._force = motion, force
        self._origin, self._rest_force = origin, rest_force
        self._mass, self._noise, self._model_error = mass, noise, model_error
        self._period, self._settings = period, settings
        count = len(force)
        self._knots = max(2, 1 + round(count * period / KNOT_SPACING))
        place = np.linspace(0, self._knots - 1, count)
        self._hats = np.clip(1 - np.abs(place[:, None] - np.arange(self._knots)[None, :]), 0, 1)
        self._gap = (count - 1) * period / (self._knots - 1)

    def simulate(self, model: Friction) -> tuple[F64, F64, FrictionState]:
        """Element forces along the move under `model`, their Jacobian, and the final state.

        The state before the move is carried over to the model and made to agree with the force
        measured at rest; the Jacobian knows of both.
        """
        state = self._state.copy()
        state.rescale(model.coulomb / self._known.coulomb)
        state.correct(self._rest_force, model)
        state.settle_at(self._origin)
        by_coulomb = state.forces / model.coulomb
        force, jacobian = follow(
            model, state, self._motion.position, self._motion.velocity, self._period, SUBSTEPS,
            start_sensitivity=by_coulomb - by_coulomb.mean(),
        )  # fmt: skip
        return force, jacobian, state

    def fit(
        self,
        belief: Belief,
        mask: NDArray[np.bool_],
        free: tuple[int, ...],
        bounds: tuple[float, float],
        guess: F64,
    ) -> Fit:
        """Solve for the `free` figures and the level from the masked samples.

        Args:
            belief: before the move: the arrival cost.
            mask: samples that count, shape (K,).
            free: figures to solve for; the others stay as believed.
            bounds: lowest and highest relative value of a figure.
            guess: figures to start from, shape (5,) or longer.

        Raises:
            ValueError: a residual that is not finite.
            numpy.linalg.LinAlgError: a problem without a solution.
        """
        fixed = [i for i in range(LEVEL) if i not in free]
        prior, information = self._arrival_cost(belief, fixed)
        velocity, acceleration = self._motion.velocity[mask], self._motion.acceleration[mask]
        measured, hats = self._force[mask], self._hats[mask]
        start, mass = self._start, self._mass
        spread = math.hypot(self._noise, self._model_error * belief.friction(start).coulomb)

        def whitened(p: F64) -> tuple[F64, F64]:
            model = model_at(start, p)
            force, by = self.simulate(model)[:2]
            by = by[mask]
            level = model.coulomb * by[:, :1] * hats
            predicted = force[mask] + level @ p[LEVEL:] + model.viscous * velocity
            predicted += mass * p[LEVEL - 1] * acceleration
            jacobian = np.column_stack(
                [
                    by[:, 0] * start.coulomb,
                    velocity * start.viscous,
                    by[:, 1] * start.stiffness,
                    by[:, 2] * start.relaxation_rate,
                    mass * acceleration,
                    level,
                ]
            )
            return (predicted - measured) / spread, jacobian / spread

        lower = np.concatenate([np.full(LEVEL, bounds[0]), np.full(self._knots, -LEVEL_BOUND)])
        upper = np.concatenate([np.full(LEVEL, bounds[1]), np.full(self._knots, LEVEL_BOUND)])
        first = prior.copy()
        first[list(free)] = guess[list(free)]
        solution = solve(whitened, prior, information, lower, upper, first)
        keep = [*range(LEVEL), len(prior) - 1]
        mean = solution.value[keep]
        covariance = solution.covariance[np.ix_(keep, keep)]
        for i in fixed:
            mean[i] = belief.mean[i]
            covariance[i, i] = belief.covariance[i, i]
        return Fit(
            Belief(mean, covariance),
            math.sqrt(solution.chi_square / max(solution.samples, 1)),
            tuple(int(i) for i in np.nonzero(solution.at_bound[:LEVEL])[0]),
            solution.evaluations,
        )

    def _arrival_cost(self, belief: Belief, fixed: list[int]) -> tuple[F64, F64]:
        """Joint prior of figures and knots: mean and inverse covariance."""
        covariance = belief.covariance.copy()
        for i in fixed:
            covariance[i, :] = 0.0
            covariance[:, i] = 0.0
            covariance[i, i] = 1e-14
        keep, walk = self._settings.wander_variance(self._gap)
        size = LEVEL + self._knots
        information = np.zeros((size, size))
        information[: LEVEL + 1, : LEVEL + 1] = np.linalg.inv(covariance)
        for j in range(LEVEL, size - 1):
            information[j, j] += keep**2 / walk
            information[j, j + 1] -= keep / walk
            information[j + 1, j] -= keep / walk
            information[j + 1, j + 1] += 1.0 / walk
        level = belief.mean[LEVEL] * keep ** np.arange(self._knots)
        return np.concatenate([belief.mean[:LEVEL], level]), information
