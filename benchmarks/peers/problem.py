"""One move as a least-squares problem, written down once for all peers.

250 samples at 1 kHz out of rest, over 25 mm, with an overshoot and back; N = 4 elements; unknown
are Coulomb force, viscous coefficient, presliding stiffness and mass, relative to the start model
(half the truth). The residual is whitened: encoder noise through the second difference, force
resolution white. First zone A for (Fc, sigma_v, mass), then all that moved for all four, from zone
A's solution and with the same arrival cost.

Two forms of the same model: `residual` runs the estimator's own compiled elements over the
samples; `steps` lists the micro-steps for packages that have to build the model themselves, with
all quantities that do not depend on the unknowns precomputed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from estimation.friction import (
    REST_BAND,
    FrictionState,
    count_states,
    follow,
    kernel_figures,
    make_constants,
)
from estimation.friction import follow_positions as follow_elements
from estimation.friction.law import Figures
from estimation.move import MoveData
from estimation.noise import quantisation
from estimation.online import BeliefSettings, Estimate, EstimatorSettings, SplitHorizonEstimator
from estimation.online.settings import BOUNDS
from estimation.online.solver.zones import SLIDE, STICK, split
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

F64 = NDArray[np.float64]

NAMES = ("coulomb", "viscous", "stiffness", "mass")
UNITS = ("N", "N s/m", "N/m", "kg")
TS, SUBSTEPS = 1e-3, 4
ENCODER, FORCE_STEP = 1e-9, 0.04
TRUE = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
TRUE_MASS = 8.0
MASS = 8.0 * 1.01
START = TRUE.scaled(0.5)
ZONE_A = (0, 1, 3)
ZONE_AB = (0, 1, 2, 3)
NO_SUBSTEPS = 4.0
"""Above this many Stribeck velocities a sample is one step, as in the estimator."""


@dataclass(frozen=True)
class Steps:
    """Micro-steps of the model, and where each sample's last one is.

    Attributes:
        dx: displacement [m], shape (S,).  direction: its sign.
        curve: s(v).  before: that of the step before.  decay: exp(-rate dt/s(v)).
        reset: 1 where the direction changes, so that all elements stick again.
        last: the step after which sample k has its force, -1 before any, shape (K - 2,).
    """

    dx: F64
    direction: F64
    curve: F64
    before: F64
    decay: F64
    reset: F64
    last: NDArray[np.int64]

    def table(self, count: int) -> F64:
        """The first `count` steps as rows dx, direction, curve, before, decay, reset."""
        columns = (self.dx, self.direction, self.curve, self.before, self.decay, self.reset)
        return np.array([c[:count] for c in columns])


@dataclass(frozen=True)
class Problem:
    """The move, its zones, the arrival cost and the whitening.

    Attributes:
        position, force: as measured [m, N], shape (K,).
        velocity, acceleration: central differences at the inner samples, shape (K - 2,).
        zone: their zone codes.
        scale: what the relative unknowns are relative to, shape (4,).
        spread: relative 1-sigma of the arrival cost; its mean is 1, shape (4,).
        lower, upper: bounds of the relative unknowns.
        settings: of the estimator.
        steps: the model as micro-steps.
    """

    position: F64
    force: F64
    velocity: F64
    acceleration: F64
    zone: NDArray[np.int8]
    scale: F64
    spread: F64
    lower: float
    upper: float
    settings: EstimatorSettings
    steps: Steps

    def rows(self, free: tuple[int, ...]) -> slice:
        """Inner samples that count where these unknowns are solved for; a single run."""
        code = SLIDE if free == ZONE_A else STICK
        chosen = np.flatnonzero(self.zone >= code)
        return slice(int(chosen[0]), int(chosen[-1]) + 1)

    def factor(self, count: int) -> F64:
        """Cholesky factor of the residual's covariance, three diagonals, shape (count, 3).

        Row k: entries (k, k - 2), (k, k - 1), (k, k).
        """
        noise = (self.settings.mass * self.settings.position_noise / TS**2) ** 2
        c0, c1, c2 = 6 * noise + self.settings.force_noise**2, -4 * noise, noise
        rows = np.zeros((count, 3))
        for k in range(count):
            second = c2 / rows[k - 2, 2] if k > 1 else 0.0
            first = (c1 - second * (rows[k - 1, 1] if k > 1 else 0.0)) / rows[k - 1, 2] if k else 0
            rows[k] = second, first, np.sqrt(c0 - first**2 - second**2)
        return rows

    def residual(self, p: F64, free: tuple[int, ...]) -> F64:
        """Whitened residual and the arrival cost's n rows at p, shape (samples + n,)."""
        rows = self.rows(free)
        out = np.empty(rows.stop - rows.start + len(free))
        compiled_residual(p, *self.arguments(free), out)
        return out

    def cost(self, p: F64, free: tuple[int, ...] = ZONE_AB) -> float:
        """Sum of squares of `residual`: what everybody minimises."""
        values = self.residual(p, free)
        return float(values @ values)

    def arguments(self, free: tuple[int, ...]) -> tuple[object, ...]:
        """What `compiled_residual` takes between p and its result."""
        rows = self.rows(free)
        return (
            self.position, self.velocity, self.acceleration, self.force, kernel_figures(START, TS),
            make_constants(START), self.scale, self.spread, np.array(free), rows.start,
            rows.stop, self.factor(rows.stop - rows.start),
        )  # fmt: skip

    def ready(self) -> tuple[SplitHorizonEstimator, MoveData]:
        """An estimator that knows the state before the move, and the move."""
        estimator = SplitHorizonEstimator(
            START, self.settings, state=FrictionState.relaxed(count_states(START))
        )
        estimator.at_rest(0.0, 0.0, -1.0)
        estimator.update(MoveData(np.zeros(5), np.zeros(5), np.ones(5, dtype=bool), -1.0, 0.0))
        valid = np.ones(len(self.position), dtype=np.bool_)
        return estimator, MoveData(self.position, self.force, valid, 0.0, 0.0)

    def relative(self, estimate: Estimate) -> tuple[F64, F64]:
        """The estimator's answer in the peers' unknowns, and its sigma."""
        model, sigma = estimate.friction, estimate.sigma
        found = np.array([model.coulomb, model.viscous, model.stiffness, estimate.mass[0]])
        spread = np.array([*(sigma[name] for name in NAMES[:3]), estimate.mass[1]])
        return found / self.scale, spread / self.scale


@numba.njit(cache=True)
def _follow(p, position, velocity, model, law, scale, free, end, elements, jacobian):  # type: ignore[no-untyped-def]
    """The estimator's compiled elements along the samples; returns the figures at p."""
    figures = scale.copy()
    for i in range(free.shape[0]):
        figures[free[i]] = p[free[i]] * scale[free[i]]
    at = Figures(
        figures[0], figures[2], model.rate, model.alpha, model.period, model.retained
    )  # fmt: skip
    n = law.elements
    follow_elements(
        law, at, figures[:1],
        (np.zeros(n), np.zeros(n, dtype=np.bool_), np.array([0.0, position[0]])),
        (position[1 : end + 1], velocity[:end]), (SUBSTEPS, REST_BAND), elements, jacobian,
    )  # fmt: skip
    return figures


@numba.njit(cache=True)
def _whiten(k, value, factor, out):  # type: ignore[no-untyped-def]
    """Whiten entry k of a column: forward substitution with the two entries before it."""
    if k > 0:
        value -= factor[k, 1] * out[k - 1]
    if k > 1:
        value -= factor[k, 0] * out[k - 2]
    out[k] = value / factor[k, 2]


@numba.njit(cache=True)
def compiled_residual(  # type: ignore[no-untyped-def]
    p, position, velocity, acceleration, force, model, law, scale, spread, free, begin, end,
    factor, out,
):  # fmt: skip
    """The estimator's compiled elements along the samples, whitened row by row, into `out`."""
    elements, jacobian = np.empty(end), np.empty((end, 3))
    figures = _follow(p, position, velocity, model, law, scale, free, end, elements, jacobian)
    for k in range(begin, end):
        row = k - begin
        value = elements[k] + figures[1] * velocity[k] + figures[3] * acceleration[k] - force[k + 1]
        _whiten(row, value, factor, out)
    for i in range(free.shape[0]):
        out[end - begin + i] = (p[free[i]] - 1.0) / spread[free[i]]


@numba.njit(cache=True)
def compiled_jacobian(  # type: ignore[no-untyped-def]
    p, position, velocity, acceleration, force, model, law, scale, spread, free, begin, end,
    factor, out,
):  # fmt: skip
    """Derivatives of `compiled_residual` by the free unknowns, a row each, into `out`."""
    elements, jacobian = np.empty(end), np.empty((end, 3))
    _follow(p, position, velocity, model, law, scale, free, end, elements, jacobian)
    count = end - begin
    for i in range(free.shape[0]):
        row = out[i]
        for k in range(count):
            if free[i] == 0:
                value = jacobian[begin + k, 0]
            elif free[i] == 1:
                value = velocity[begin + k]
            elif free[i] == 2:
                value = jacobian[begin + k, 1]
            else:
                value = acceleration[begin + k]
            _whiten(k, value * scale[free[i]], factor, row)
        for j in range(free.shape[0]):
            row[count + j] = 0.0
        row[count + i] = 1.0 / spread[free[i]]


def build(samples: int = 250) -> Problem:
    """The move of the comparison, with seeded noise."""
    motion = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))
    time = np.arange(-3, samples - 3) * TS
    clean = motion.sample(time)[0]
    # It overshoots by 1 um and comes back once, as a damped loop does: zone B.
    after = np.clip(time - motion.duration, 0.0, None) / 6e-3
    clean = clean + 1e-6 * after**2 * np.exp(2.0 * (1.0 - after))
    model, mass = TRUE, TRUE_MASS
    velocity, acceleration = differences(clean)
    elements, _ = follow(
        model, FrictionState.relaxed(4, float(clean[0])), clean[1:-1], velocity, TS
    )
    inner = elements + model.viscous * velocity + mass * acceleration
    exact = np.concatenate([[0.0], inner, inner[-1:]])
    rng = np.random.default_rng(1)
    position = clean + rng.normal(0.0, ENCODER, samples)
    force = np.round(exact / FORCE_STEP) * FORCE_STEP
    belief = BeliefSettings(wander=0.0)
    settings = EstimatorSettings(
        MASS, TS, ENCODER, quantisation(FORCE_STEP), model_error=0.0, belief=belief,
        fixed=("relaxation_rate",),
    )  # fmt: skip
    chosen = [0, 1, 2, 4]
    # The prior has aged by two moves: the rest that made the state known, and this move.
    spread = np.sqrt(
        np.square(belief.start_spread)[chosen] + 2 * np.square(belief.drift)[chosen] + 1e-12
    )
    velocity, acceleration = differences(position)
    return Problem(
        position, force, velocity, acceleration, split(position, START, TS),
        np.array([START.coulomb, START.viscous, START.stiffness, MASS]), spread,
        *BOUNDS, settings, micro_steps(position, velocity),
    )  # fmt: skip


def differences(position: F64) -> tuple[F64, F64]:
    """Central first and second differences at the inner samples."""
    velocity = (position[2:] - position[:-2]) / (2 * TS)
    return velocity, (position[2:] - 2 * position[1:-1] + position[:-2]) / TS**2


def micro_steps(position: F64, velocity: F64) -> Steps:
    """The estimator's steps: none at rest, four per sample near the Stribeck velocity, else one."""
    dx, direction, curve, before, decay, reset, last = [], [], [], [], [], [], []
    reference, heading = position[0], 0.0
    for k, v1 in enumerate(velocity):
        moved = position[k + 1] - reference
        if abs(moved) > REST_BAND:
            reference = position[k + 1]
            v0 = velocity[k - 1] if k else v1
            slowest = min(v0 * heading, v1 * heading)
            count = 1 if slowest > NO_SUBSTEPS * START.stribeck_velocity else SUBSTEPS
            dt = TS / count
            for j in range(count):
                v = v0 + (v1 - v0) * (j + 0.5) / count + moved / TS - 0.5 * (v0 + v1)
                s, s0 = (
                    1 + START.static_ratio * np.exp(-abs(u) / START.stribeck_velocity)
                    for u in (v, v0)
                )
                before.append(curve[-1] if curve else s0)
                dx.append(v * dt)
                direction.append(np.sign(v))
                curve.append(s)
                decay.append(np.exp(-START.relaxation_rate * dt / s))
                reset.append(float(direction[-1] != heading))
                heading = direction[-1]
        last.append(len(dx) - 1)
    return Steps(
        np.array(dx), np.array(direction), np.array(curve), np.array(before), np.array(decay),
        np.array(reset), np.array(last),
    )  # fmt: skip
