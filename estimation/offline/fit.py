"""The least squares behind `identify`: all records of an axis at once.

Minimises arrival cost and whitened residual over the unknowns that all blocks share, and over the
knots of each (`linearise`). Gauss-Newton in a box (`estimation.least_squares`), steps halved where
the cost rises.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.least_squares import gauss_newton_step
from estimation.offline.linearise import NormalEquations, Point, Residual
from estimation.offline.records import OfflineSettings, Record
from estimation.offline.unknowns import Unknowns
from stagedata import F64

MAX_ITERATIONS, HALVINGS, TOLERANCE = 25, 6, 0.02
"""A step below TOLERANCE posterior standard deviations ends it ..."""
LEAST_GAIN = 0.2, 1e-4
"""... and so does a fall of the cost below this, absolutely or relatively: breakaways are kinks, on
whose scale the cost is rough."""
WIDEST_LEVEL = 0.5
"""Bound of the knots, either way."""


class NoSolutionError(Exception):
    """The problem is not finite, or has no minimum."""


@dataclass(frozen=True, slots=True)
class Fit:
    """A minimum.

    Attributes:
        q: all unknowns in their scales, shape (n,).
        covariance: of them, those not solved for at zero, shape (n, n).
        scores: half the gradient of each block's chi-square at the minimum, knots eliminated,
            shape (blocks, n).
        costs: of each block, chi-square of its residual and of its knots under their prior,
            shape (blocks,).
        chi: sum of the squared whitened residuals over the counted blocks.
        samples: how many they are.
        levels: knots of every block.
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


@dataclass(frozen=True, slots=True)
class _Iterate:
    """A point of the descent, its normal equations, and its cost with the arrival cost."""

    point: Point
    equations: NormalEquations
    cost: float


class Problem:
    """Records and unknowns of one axis; `solve` finds a minimum.

    Args:
        records: of the axis.
        unknowns: what is estimated.
        settings: noise of the residual.

    Attributes:
        counted: blocks that have a sample that counts.
        speeds: highest speed in each block [m/s].
    """

    def __init__(
        self, records: Sequence[Record], unknowns: Unknowns, settings: OfflineSettings
    ) -> None:
        self.unknowns = unknowns
        self.counted = [bool(r.used[a:b].any()) for r in records for a, b in r.blocks]
        self.speeds = [float(np.abs(r.velocity[a:b]).max()) for r in records for a, b in r.blocks]
        self._residual = Residual(records, unknowns, settings)
        self._wander = max(settings.wander, 1e-3)

    @property
    def blocks(self) -> int:
        """Number of blocks, those that do not count included."""
        return len(self.counted)

    def solve(
        self,
        q: F64,
        free: NDArray[np.bool_],
        levels: tuple[F64, ...] | None = None,
        counted: Sequence[bool] | None = None,
        errors_in_variables: bool = False,
    ) -> Fit:
        """Find a minimum over the free unknowns and all knots, starting from `q`.

        Args:
            q: where to begin, in scales, shape (n,); what is not free stays there.
            free: what to solve for, shape (n,).
            levels: knots to begin at; default: no wander.
            counted: blocks that count; default all.
            errors_in_variables: take the measured acceleration for as noisy as the residual. The
                slope is then not that of the cost: one whole step, from a minimum without.

        Raises:
            NoSolutionError: not finite, or no minimum.
        """
        u = self.unknowns
        counted = self.counted if counted is None else counted
        if levels is None:
            levels = tuple(np.zeros(k) for k in self._residual.knots)
        q = np.clip(q, u.lower, u.upper)
        now = self._evaluate(Point(q, levels, np.flatnonzero(free), errors_in_variables), counted)
        if errors_in_variables:
            step, moves, _ = self._find_step(now)
            return self._finish(self._evaluate(self._shift(now.point, step, moves), counted), False)
        for _ in range(MAX_ITERATIONS):
            step, moves, size = self._find_step(now)
            then = self._descend(now, step, moves, counted)
            if then is None:
                return self._finish(now, True)
            gained, now = now.cost - then.cost, then
            if size < TOLERANCE or gained < max(LEAST_GAIN[0], LEAST_GAIN[1] * now.cost):
                return self._finish(now, True)
        return self._finish(now, False)

    def _evaluate(self, point: Point, counted: Sequence[bool]) -> _Iterate:
        u, equations = self.unknowns, self._residual.linearise(point, counted)
        away = (point.q[point.index] - u.mean[point.index]) / u.spread[point.index]
        return _Iterate(point, equations, equations.cost + float(away @ away))

    def _find_step(self, now: _Iterate) -> tuple[F64, list[F64], float]:
        """Gauss-Newton step of unknowns and knots, and its length in standard deviations."""
        if not math.isfinite(now.cost):
            raise NoSolutionError("the residual is not finite")
        u, index = self.unknowns, now.point.index
        step, size = np.zeros(0), 0.0
        if len(index):
            step, size = gauss_newton_step(
                now.equations.curvature, now.equations.slope, self._information(index),
                u.mean[index], now.point.q[index], u.lower[index], u.upper[index],
            )  # fmt: skip
        moves = now.equations.knot_steps(step)
        largest = max((float(np.abs(m).max()) for m in moves), default=0.0)
        size = math.hypot(size, largest / self._wander)
        if not math.isfinite(size):
            raise NoSolutionError("no minimum")
        return step, moves, size

    def _descend(
        self, now: _Iterate, step: F64, moves: list[F64], counted: Sequence[bool]
    ) -> _Iterate | None:
        """Take the step, halved until the cost does not rise; None where it always does."""
        for _ in range(HALVINGS):
            then = self._evaluate(self._shift(now.point, step, moves), counted)
            if then.cost <= now.cost * (1.0 + 1e-12):
                return then
            step, moves = step * 0.5, [m * 0.5 for m in moves]
        return None

    def _shift(self, point: Point, step: F64, moves: list[F64]) -> Point:
        """The point a step of unknowns and knots further, inside the box."""
        u, index, q = self.unknowns, point.index, point.q.copy()
        q[index] = np.clip(q[index] + step, u.lower[index], u.upper[index])
        levels = tuple(
            np.clip(w + m, -WIDEST_LEVEL, WIDEST_LEVEL)
            for w, m in zip(point.levels, moves, strict=True)
        )
        return replace(point, q=q, levels=levels)

    def _information(self, index: NDArray[np.int64]) -> F64:
        """Inverse prior covariance of the unknowns at `index`, in scales."""
        return np.diag(1.0 / self.unknowns.spread[index] ** 2)

    def _finish(self, now: _Iterate, converged: bool) -> Fit:
        """The fit at the last iterate, with its covariance."""
        point, equations = now.point, now.equations
        n, index = len(point.q), point.index
        covariance = np.zeros((n, n))
        if len(index):
            try:
                covariance[np.ix_(index, index)] = np.linalg.inv(
                    self._information(index) + equations.curvature
                )
            except np.linalg.LinAlgError as error:
                raise NoSolutionError("no minimum") from error
        scores = np.zeros((self.blocks, n))
        scores[:, index] = equations.scores
        return Fit(
            point.q, covariance, scores, equations.costs, equations.chi, equations.samples,
            point.levels, converged,
        )  # fmt: skip
