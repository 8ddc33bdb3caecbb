"""One move as a bounded least-squares problem with an arrival cost.

The residual is measured force minus friction model minus apparent mass times acceleration, the
model driven by the measured positions from the friction state at rest before the move. Inside the
move the level w is an unknown at a few knots, joined by its Gauss-Markov process, so that the
wander of a real stage is modelled and not averaged into the figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from estimation.belief import (
    COULOMB,
    LEVEL,
    MASS,
    RATE,
    STIFFNESS,
    VISCOUS,
    Belief,
    BeliefSettings,
)
from estimation.gms import (
    ALPHA,
    F64,
    REST_BAND,
    Friction,
    FrictionState,
    correct_forces,
    element_shares,
    follow,
    follow_positions,
)
from estimation.gms import COULOMB as MODEL_COULOMB
from estimation.gms import RATE as MODEL_RATE
from estimation.gms import STIFFNESS as MODEL_STIFFNESS
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
        self._gap = (count - 1) * period / (self._knots - 1)

    def final_state(self, model: Friction) -> FrictionState:
        """The friction state at the end of the move under `model`.

        The state before the move is carried over to the model and made to agree with the force
        measured at rest.
        """
        state = self._state.copy()
        state.rescale(model.coulomb / self._known.coulomb)
        state.correct(self._rest_force, model)
        state.settle_at(self._origin)
        follow(model, state, self._motion.position, self._motion.velocity, self._period, SUBSTEPS)
        return state

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
        start = self._start
        figures = np.array(
            [start.coulomb, start.viscous, start.stiffness, start.relaxation_rate, self._mass]
        )
        spread = math.hypot(self._noise, self._model_error * belief.friction(start).coulomb)
        shape = start.vector()
        shares = element_shares(start.elements)
        state, motion = self._state, self._motion

        def normal_equations(p: F64) -> tuple[F64, F64, float]:
            curvature, slope = np.zeros((len(p), len(p))), np.zeros(len(p))
            chi_square = _normal_equations(
                p, figures, shape, shares, state.forces, self._known.coulomb, self._rest_force,
                state.memory[0], state.slipping, self._origin, motion.position, motion.velocity,
                motion.acceleration, self._force, mask, spread, self._period, curvature, slope,
            )  # fmt: skip
            return curvature, slope, float(chi_square)

        lower = np.concatenate([np.full(LEVEL, bounds[0]), np.full(self._knots, -LEVEL_BOUND)])
        upper = np.concatenate([np.full(LEVEL, bounds[1]), np.full(self._knots, LEVEL_BOUND)])
        first = prior.copy()
        first[list(free)] = guess[list(free)]
        solution = solve(normal_equations, prior, information, lower, upper, first)
        keep = [*range(LEVEL), len(prior) - 1]
        mean = solution.value[keep]
        covariance = solution.covariance[np.ix_(keep, keep)]
        for i in fixed:
            mean[i] = belief.mean[i]
            covariance[i, i] = belief.covariance[i, i]
        return Fit(
            Belief(mean, covariance),
            math.sqrt(solution.chi_square / max(int(mask.sum()), 1)),
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


@numba.njit(cache=True)
def _normal_equations(  # type: ignore[no-untyped-def]
    p, figures, shape, shares, forces, known_coulomb, rest_force, direction, slipping, origin,
    position, velocity, acceleration, force, mask, spread, period, curvature, slope,
):  # fmt: skip
    """Fill J'J and J'r of the whitened residual (predicted minus measured), return r'r.

    `p`: relative figures, then the level at each knot; `figures`: what they are relative to;
    `shape`: friction model as `Friction.vector`, of which the figures replace their part;
    `forces`: F_i at rest before the move under a Coulomb force of `known_coulomb`, with
    `direction` and `slipping` as the motion before it left them.
    """
    count, unknowns = shares.shape[0], p.shape[0]
    knots = unknowns - LEVEL
    model = shape.copy()
    coulomb = figures[COULOMB] * p[COULOMB]
    model[MODEL_COULOMB] = coulomb
    model[MODEL_STIFFNESS] = figures[STIFFNESS] * p[STIFFNESS]
    model[MODEL_RATE] = figures[RATE] * p[RATE]
    viscous, mass = figures[VISCOUS] * p[VISCOUS], figures[MASS] * p[MASS]
    # The rest scales with the Coulomb force, but its sum is what was measured.
    state = forces * (coulomb / known_coulomb)
    correct_forces(state, shares, coulomb * (1.0 + shape[ALPHA]), rest_force)
    d_coulomb = (state - state.mean()) / coulomb
    samples = position.shape[0]
    friction = np.empty(samples)
    by = np.empty((samples, 3))
    memory = np.array([direction, origin])
    follow_positions(
        model, shares, state, slipping.copy(), memory, position, velocity, period, SUBSTEPS,
        REST_BAND, friction, by, d_coulomb, np.zeros(count), np.zeros(count),
    )  # fmt: skip
    row = np.zeros(unknowns)
    chi_square = 0.0
    for k in range(samples):
        if not mask[k]:
            continue
        # The level is linear between knots.
        place = k * (knots - 1) / (samples - 1)
        knot = min(int(place), knots - 2)
        share = place - knot
        level = p[LEVEL + knot] * (1.0 - share) + p[LEVEL + knot + 1] * share
        scale = coulomb * by[k, 0]
        predicted = friction[k] + level * scale + viscous * velocity[k] + mass * acceleration[k]
        residual = (predicted - force[k]) / spread
        chi_square += residual * residual
        row[:] = 0.0
        row[COULOMB] = by[k, 0] * figures[COULOMB] / spread
        row[VISCOUS] = velocity[k] * figures[VISCOUS] / spread
        row[STIFFNESS] = by[k, 1] * figures[STIFFNESS] / spread
        row[RATE] = by[k, 2] * figures[RATE] / spread
        row[MASS] = acceleration[k] * figures[MASS] / spread
        row[LEVEL + knot] = scale * (1.0 - share) / spread
        row[LEVEL + knot + 1] = scale * share / spread
        for i in range(unknowns):
            if row[i] != 0.0:
                slope[i] += row[i] * residual
                for j in range(unknowns):
                    curvature[i, j] += row[i] * row[j]
    return chi_square
