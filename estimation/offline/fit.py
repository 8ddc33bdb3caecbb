"""The least squares behind `identify`: all records of an axis at once, block by block.

Minimises arrival cost and whitened residual (force predicted minus measured) over the unknowns that
all blocks share, and over what each block has for itself and is eliminated inside it: the level's
knots, and a factor on the state that it starts from. Gauss-Newton in a box
(`estimation.least_squares`), steps halved where the cost rises.

Encoder noise enters the residual through the second difference, neighbouring residuals share it:
they are whitened by the banded Cholesky factor of their covariance. What the model misses counts as
white noise of `model_error`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import kernel
from estimation.friction import F64, REST_BAND
from estimation.least_squares import gauss_newton_step
from estimation.offline.model import lead
from estimation.offline.records import Record
from estimation.offline.unknowns import (
    ALPHA,
    ASYMMETRY,
    COULOMB,
    DELTA,
    FIGURES,
    LAG,
    MASS,
    OFFSET,
    RATE,
    RIPPLE,
    STIFFNESS,
    VISCOUS,
    VS,
    Unknowns,
)

KNOT_SPACING = 0.03
MAX_ITERATIONS, HALVINGS, TOLERANCE = 25, 6, 0.02
"""A step below TOLERANCE posterior standard deviations ends it ..."""
LEAST_GAIN = 0.2, 1e-4
"""... and so does a fall of the cost below this, absolutely or relatively: breakaways are kinks, on
whose scale the cost is rough."""


_FIGURES = len(FIGURES)


class NoSolutionError(Exception):
    """The problem is not finite, or has no minimum."""


@dataclass(frozen=True, slots=True)
class Noise:
    """What the residual is made of besides the model.

    Attributes:
        period: of the samples [s].
        position: rms of a sampled position [m].
        force: rms of a sampled force [N].
        model: rms of what the model misses [N].
        wander: rms of the level.  correlation_time: of it [s].
    """

    period: float
    position: float
    force: float
    model: float
    wander: float
    correlation_time: float


@dataclass(frozen=True, slots=True)
class Fit:
    """A minimum.

    Attributes:
        q: all unknowns in their scales, shape (n,).
        covariance: of them, those not solved for at zero, shape (n, n).
        scores: half the gradient of each block's chi-square at the minimum, knots eliminated,
            shape (blocks, n).
        costs: of each block, what its residual and the wander of its level are improbable by,
            shape (blocks,).
        chi: sum of the squared whitened residuals over the counted blocks.
        samples: how many they are.
        levels: w at the knots of every block.
        converged: False where the steps allowed did not suffice: then it is no minimum.
    """

    q: F64
    covariance: F64
    scores: F64
    costs: F64
    chi: float
    samples: int
    levels: tuple[F64, ...]
    converged: bool = True

    @property
    def misfit(self) -> float:
        """Rms of the whitened residual."""
        return math.sqrt(self.chi / max(self.samples, 1))


class Problem:
    """Records, noise and unknowns of one axis; `solve` finds a minimum.

    Args:
        records: of the axis.
        unknowns: what is estimated.
        noise: of the residual.

    Attributes:
        counted: blocks that have a sample that counts.
        speeds: highest speed in each block [m/s].
    """

    def __init__(self, records: Sequence[Record], unknowns: Unknowns, noise: Noise) -> None:
        self.records, self.unknowns, self.noise = records, unknowns, noise
        self.counted = [bool(r.used[a:b].any()) for r in records for a, b in r.blocks]
        self.speeds = [float(np.abs(r.velocity[a:b]).max()) for r in records for a, b in r.blocks]
        self._knots = [self._knots_of(b - a) for r in records for a, b in r.blocks]
        self._priors = [self._knot_prior(k) for k in self._knots]

    @property
    def blocks(self) -> int:
        """How many there are, those that count for nothing included."""
        return len(self._knots)

    def start_levels(self) -> tuple[F64, ...]:
        """No wander anywhere."""
        return tuple(np.zeros(k) for k in self._knots)

    def solve(
        self,
        q: F64,
        free: NDArray[np.bool_],
        levels: tuple[F64, ...] | None = None,
        counted: Sequence[bool] | None = None,
        both: bool = False,
    ) -> Fit:
        """A minimum over the free unknowns and all knots, from `q` (long: one damped Gauss-Newton).

        Args:
            q: where to begin, in scales, shape (n,); what is not free stays there.
            free: what to solve for, shape (n,).
            levels: knots to begin at; default none.
            counted: blocks that count; default all.
            both: take the measured acceleration for as noisy as the residual, see `whitened`. That
                is no slope of the cost: one whole step, from a minimum for an exact one.

        Raises:
            NoSolutionError: not finite, or no minimum.
        """
        u = self.unknowns
        counted = list(self.counted if counted is None else counted)
        q, index = np.clip(q, u.lower, u.upper), np.flatnonzero(free)
        levels = self.start_levels() if levels is None else levels
        information = np.diag(1.0 / u.spread[index] ** 2)
        now = self._linearised(q, levels, index, counted, both)
        cost = now.cost + self._away(q, index)
        converged = False
        for _ in range(1 if both else MAX_ITERATIONS):
            if not math.isfinite(cost):
                raise NoSolutionError("the residual is not finite")
            step, size = self._step(now, q, index, information)
            moves = now.knot_moves(step)
            size = math.hypot(size, max((float(np.abs(m).max()) for m in moves), default=0.0)
                              / max(self.noise.wander, 1e-3))  # fmt: skip
            if not math.isfinite(size):
                raise NoSolutionError("no minimum")
            improved = False
            for _ in range(HALVINGS):
                trial = q.copy()
                trial[index] = np.clip(q[index] + step, u.lower[index], u.upper[index])
                shifted = tuple(
                    np.clip(w + m, -0.5, 0.5) for w, m in zip(levels, moves, strict=True)
                )
                then = self._linearised(trial, shifted, index, counted, both)
                lower = then.cost + self._away(trial, index)
                if both or lower <= cost * (1.0 + 1e-12):
                    improved = True
                    break
                step, moves = step * 0.5, [m * 0.5 for m in moves]
            if not improved:
                converged = True
                break
            gained, q, levels, now, cost = cost - lower, trial, shifted, then, lower
            if size < TOLERANCE or gained < max(LEAST_GAIN[0], LEAST_GAIN[1] * cost):
                converged = True
                break
        covariance = np.zeros((len(q), len(q)))
        if len(index):
            try:
                covariance[np.ix_(index, index)] = np.linalg.inv(information + now.curvature)
            except np.linalg.LinAlgError as error:
                raise NoSolutionError("no minimum") from error
        scores = np.zeros((len(counted), len(q)))
        scores[:, index] = now.scores
        return Fit(q, covariance, scores, now.costs, now.chi, now.samples, levels, converged)

    def _step(self, now: _Linear, q: F64, index: NDArray[np.int64], information: F64
              ) -> tuple[F64, float]:  # fmt: skip
        u = self.unknowns
        if len(index) == 0:
            return np.zeros(0), 0.0
        step, size = gauss_newton_step(
            now.curvature, now.slope, information, u.mean[index], q[index], u.lower[index],
            u.upper[index],
        )  # fmt: skip
        return step, float(size)

    def _away(self, q: F64, index: NDArray[np.int64]) -> float:
        u = self.unknowns
        away = (q[index] - u.mean[index]) / u.spread[index]
        return float(away @ away)

    def _knots_of(self, samples: int) -> int:
        return max(2, 1 + math.ceil(samples * self.noise.period / KNOT_SPACING)) + 1

    def _knot_prior(self, count: int) -> F64:
        """Inverse covariance of a stationary Gauss-Markov process at the knots; then of the start.

        The last one is how far the element forces at the start of the block are off what they
        would be without wander: they were left at a level of their own.
        """
        variance = max(self.noise.wander, 1e-6) ** 2
        keep = math.exp(-KNOT_SPACING / self.noise.correlation_time)
        walk = (1.0 - keep**2) * variance
        matrix = np.zeros((count, count))
        matrix[0, 0] = matrix[-1, -1] = 1.0 / variance
        for j in range(count - 2):
            matrix[j, j] += keep**2 / walk
            matrix[j, j + 1] = matrix[j + 1, j] = -keep / walk
            matrix[j + 1, j + 1] += 1.0 / walk
        return matrix

    def _linearised(
        self, q: F64, levels: tuple[F64, ...], index: NDArray[np.int64], counted: list[bool],
        both: bool,
    ) -> _Linear:  # fmt: skip
        """Normal equations of all blocks at q, knots eliminated (long: one block after another)."""
        u, noise = self.unknowns, self.noise
        springs, shares = u.shape(q)
        figures = (u.scale * q)[: len(FIGURES)]
        theta = figures[[COULOMB, STIFFNESS, RATE, ALPHA, VS, DELTA, ASYMMETRY]]
        others = figures[[VISCOUS, MASS, OFFSET, LAG]]
        slopes = u.slopes(q)
        place = np.flatnonzero(index == MASS)
        mass = int(place[0]) if both and len(place) else -1
        weighed = figures[MASS] if both else u.scale[MASS]
        per_mass = u.scale[MASS] / weighed
        variances = np.array(
            [
                (weighed * noise.position / noise.period**2) ** 2,
                noise.force**2 + noise.model**2,
            ]
        )
        result = _Linear(len(index), self.blocks)
        number = 0
        for record in self.records:
            forces, memory = np.zeros(u.elements), np.array([0.0, record.position[0]])
            slipping = np.zeros(u.elements, dtype=np.bool_)
            kept = np.zeros((u.elements, 9))
            for begin, end in record.blocks:
                w = levels[number]
                size, inner = end - begin, slice(begin, end)
                driven = (record.position[begin + 1 : end + 1], record.velocity[inner])
                if counted[number]:
                    derivative = np.zeros((u.elements, 9 + len(w)))
                    derivative[:, :9] = kept * (1.0 + w[-1])
                    derivative[:, -1] = forces
                    force = np.empty(size)
                    jacobian = np.empty((size, 7 + 2 * u.elements + len(w)))
                    lead(
                        theta, springs, shares, forces * (1.0 + w[-1]), slipping.copy(),
                        derivative, memory.copy(), w[:-1], KNOT_SPACING, *driven, noise.period,
                        REST_BAND, force, jacobian,
                    )  # fmt: skip
                    rows = columns(
                        force, jacobian, record.velocity[inner], record.acceleration[inner],
                        record.ripple[inner], record.force[begin + 1 : end + 1], others,
                        figures[list(RIPPLE)], slopes, index, len(w), u.elements, noise.period,
                    )  # fmt: skip
                    normal, slope, chi, used = whitened(
                        rows, record.used[inner], variances, mass, per_mass
                    )
                    result.add(number, normal, slope, chi, used, self._priors[number], w)
                else:
                    result.skip(len(w))
                number += 1
                # What the next block starts from: this one without wander.
                carried = np.zeros((u.elements, 11))
                carried[:, :9] = kept
                lead(
                    theta, springs, shares, forces, slipping, carried, memory, np.zeros(2),
                    2.0 * size * noise.period, *driven, noise.period, REST_BAND, np.empty(size),
                    np.empty((size, 9 + 2 * u.elements)),
                )  # fmt: skip
                kept = carried[:, :9]
        return result


class _Linear:
    """Sums over blocks of J'J and J'r with the knots eliminated, and what brings the knots back."""

    def __init__(self, unknowns: int, blocks: int) -> None:
        self.curvature, self.slope = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
        self.scores = np.zeros((blocks, unknowns))
        self.costs = np.zeros(blocks)
        self.chi, self.cost, self.samples = 0.0, 0.0, 0
        self._back: list[tuple[F64, F64]] = []

    def add(
        self, number: int, normal: F64, slope: F64, chi: float, used: int, prior: F64, level: F64
    ) -> None:
        """One block; the last rows of `normal` are its knots'."""
        n = len(self.slope)
        knots = normal[n:, n:] + prior
        pull = slope[n:] + prior @ level
        # Knots in terms of the unknowns: w = -(A d + b).
        solved: F64 = np.linalg.solve(knots, np.column_stack([normal[n:, :n], pull])).astype(
            np.float64
        )
        per_unknown, rest = solved[:, :n], solved[:, n]
        self.curvature += normal[:n, :n] - normal[:n, n:] @ per_unknown
        score = slope[:n] - normal[:n, n:] @ rest
        self.slope += score
        self.scores[number] = score
        self.chi += chi
        self.costs[number] = chi + float(level @ prior @ level)
        self.cost += self.costs[number]
        self.samples += used
        self._back.append((per_unknown, rest))

    def skip(self, knots: int) -> None:
        """A block that counts for nothing."""
        self._back.append((np.zeros((knots, len(self.slope))), np.zeros(knots)))

    def knot_moves(self, step: F64) -> list[F64]:
        """Change of every block's knots that belongs to a step of the unknowns."""
        return [-(per_unknown @ step + rest) for per_unknown, rest in self._back]


@kernel()
def columns(  # type: ignore[no-untyped-def]
    force, jacobian, velocity, acceleration, regressors, measured, others, ripple, slopes, index,
    knots, elements, period,
):  # fmt: skip
    """Jacobian by unknowns (in scales) and knots, residual last, (M, n + K + 1); 13 arguments.

    `others`: viscous coefficient, mass, force offset, lag; `ripple`: its figures, and `regressors`
    what they stand for, shape (M, 3). The force is measured `lag` late: force
    and derivatives are shifted by it along their own slope.
    """
    count, n = force.shape[0], index.shape[0]
    width = n + knots + 1
    rows = np.zeros((count, width))
    raw = np.zeros(_FIGURES + 2 * elements)
    nominal = slopes[MASS, MASS]
    for k in range(count):
        raw[COULOMB], raw[STIFFNESS], raw[RATE] = jacobian[k, 0], jacobian[k, 1], jacobian[k, 2]
        raw[ALPHA], raw[VS], raw[DELTA] = jacobian[k, 3], jacobian[k, 4], jacobian[k, 5]
        raw[ASYMMETRY], raw[VISCOUS], raw[OFFSET] = jacobian[k, 6], velocity[k], 1.0
        raw[MASS] = acceleration[k]
        for i in range(3):
            raw[RIPPLE[i]] = regressors[k, i] * nominal
        for i in range(2 * elements):
            raw[_FIGURES + i] = jacobian[k, 7 + i]
        for a in range(n):
            j = index[a]
            if j < _FIGURES:
                rows[k, a] = raw[j] * slopes[j, j]
            else:
                begin = _FIGURES if j < _FIGURES + elements else _FIGURES + elements
                total = 0.0
                for i in range(begin, begin + elements):
                    total += raw[i] * slopes[i, j]
                rows[k, a] = total
        for c in range(knots):
            rows[k, n + c] = jacobian[k, 7 + 2 * elements + c]
        rows[k, width - 1] = (
            force[k] + others[0] * velocity[k] + others[1] * acceleration[k] + others[2]
        )
        for i in range(3):
            rows[k, width - 1] += ripple[i] * raw[RIPPLE[i]]
    lag = others[3]
    shifted = rows.copy()
    for k in range(1, count - 1):
        for c in range(width):
            shifted[k, c] -= lag * (rows[k + 1, c] - rows[k - 1, c]) / (2.0 * period)
        for a in range(n):
            if index[a] == LAG:
                rise = (rows[k + 1, width - 1] - rows[k - 1, width - 1]) / (2.0 * period)
                shifted[k, a] = -rise * slopes[LAG, LAG]
    for k in range(count):
        shifted[k, width - 1] -= measured[k]
    return shifted


@kernel()
def whitened(rows, used, variances, mass, per_mass):  # type: ignore[no-untyped-def]
    """J'J, J'r, r'r and samples of the whitened rows; a gap in `used` begins a new run.

    `variances`: of the encoder's noise as a force, m^2 s^2/T^4, and of the white part. Column
    `mass` (-1: as it is) has the measured acceleration, and with it the same noise as the
    residual. What the residual shows of that noise is taken out of it: the derivative is that at
    the most probable positions, as of any fit with errors in both. `per_mass`: what a unit of that
    column is of the mass.
    """
    count, width = rows.shape
    n = width - 1
    c0 = 6.0 * variances[0] + variances[1]
    c1, c2 = -4.0 * variances[0], variances[0]
    factor = np.zeros((count, 3))  # pivot, and what it takes of the rows one and two before
    pivot = before = 1.0
    off = 0.0
    run = 0
    for k in range(1, count - 1):
        if not used[k]:
            run = 0
            continue
        second = c2 / before if run > 1 else 0.0
        first = (c1 - second * off) / pivot if run > 0 else 0.0
        before = pivot
        pivot = math.sqrt(c0 - first * first - second * second)
        off = first
        factor[k, 0], factor[k, 1], factor[k, 2] = pivot, first, second
        run += 1
    if mass >= 0:
        _take_noise_out(rows, factor, variances[0] * per_mass, mass)
    normal, slope = np.zeros((n, n)), np.zeros(n)
    this, last, older = np.zeros(width), np.zeros(width), np.zeros(width)
    chi = 0.0
    samples = 0
    for k in range(1, count - 1):
        pivot, first, second = factor[k]
        if pivot == 0.0:
            continue
        for c in range(width):
            this[c] = (rows[k, c] - first * last[c] - second * older[c]) / pivot
        residual = this[n]
        chi += residual * residual
        for a in range(n):
            entry = this[a]
            if entry != 0.0:
                slope[a] += entry * residual
                for b in range(a + 1):
                    normal[a, b] += entry * this[b]
        older, last, this = last, this, older
        samples += 1
    for a in range(n):
        for b in range(a):
            normal[b, a] = normal[a, b]
    return normal, slope, chi, samples


@kernel()
def _take_noise_out(rows, factor, variance, mass):  # type: ignore[no-untyped-def]
    """Column `mass` less the part of the encoder's noise that the residual shows."""
    count, n = rows.shape[0], rows.shape[1] - 1
    pull = np.zeros(count)  # S^-1 r
    last = older = 0.0
    for k in range(1, count - 1):
        if factor[k, 0] > 0.0:
            pull[k] = (rows[k, n] - factor[k, 1] * last - factor[k, 2] * older) / factor[k, 0]
            older, last = last, pull[k]
    for k in range(count - 2, 0, -1):
        if factor[k, 0] > 0.0:
            after = factor[k + 1, 1] * pull[k + 1]
            later = factor[k + 2, 2] * pull[k + 2] if k + 2 < count else 0.0
            pull[k] = (pull[k] - after - later) / factor[k, 0]
    for k in range(2, count - 2):
        if factor[k, 0] > 0.0:
            bend = pull[k - 2] + pull[k + 2] - 4.0 * (pull[k - 1] + pull[k + 1]) + 6.0 * pull[k]
            rows[k, mass] -= variance * bend
