"""Bounded Gauss-Newton with an arrival cost; equation (4) of the source paper.

Minimises  |p - prior|^2 in P^-1  +  sum r_k(p)^2 / R_k  with  lower <= p <= upper.
Few unknowns, many samples: the model hands over its normal equations, each step is a quadratic
problem in a box, solved by an active set (compiled); steps are halved where the cost rises.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

Model = Callable[[F64], tuple[F64, F64, float]]
"""Unknowns, shape (n,) -> normal equations of the whitened residual r with Jacobian J:
J'J, shape (n, n), J'r, shape (n,), and r'r."""

_HALVINGS = 4


@dataclass(frozen=True, slots=True)
class Solution:
    """Outcome of a bounded least-squares problem.

    Attributes:
        value: unknowns, shape (n,).
        covariance: of them, arrival cost included, shape (n, n).
        chi_square: sum of squared whitened residuals at the solution, without arrival cost.
        iterations, evaluations: of the solver.
        at_bound: which unknowns lie on a bound, shape (n,).
        converged: whether the last step was small.
    """

    value: F64
    covariance: F64
    chi_square: float
    iterations: int
    evaluations: int
    at_bound: NDArray[np.bool_]
    converged: bool


def solve(
    model: Model,
    prior: F64,
    information: F64,
    lower: F64,
    upper: F64,
    guess: F64 | None = None,
    max_iterations: int = 12,
    tolerance: float = 0.05,
) -> Solution:
    """Minimise arrival cost plus squared residuals.

    Args:
        model: normal equations; unknowns are best scaled to about 1.
        prior: mean of the arrival cost, shape (n,).
        information: P^-1 of the arrival cost, positive definite, shape (n, n).
        lower: bounds, shape (n,).
        upper: bounds, shape (n,), above `lower`.
        guess: first iterate, shape (n,); default the prior.
        max_iterations: of Gauss-Newton.
        tolerance: a step below this many posterior standard deviations ends it.

    Raises:
        ValueError: a residual that is not finite.
        numpy.linalg.LinAlgError: normal equations that are not positive definite.
    """
    value = np.minimum(np.maximum(prior if guess is None else guess, lower), upper)
    curvature, slope, chi_square = _evaluate(model, value)
    cost = chi_square + _away(value, prior, information)
    evaluations, iterations, converged = 1, 0, False
    while iterations < max_iterations and not converged:
        iterations += 1
        step, size = _step(curvature, slope, information, prior, value, lower, upper)
        if not math.isfinite(size):
            raise np.linalg.LinAlgError("normal equations are not positive definite")
        for _ in range(_HALVINGS):
            trial = np.minimum(np.maximum(value + step, lower), upper)
            evaluated = _evaluate(model, trial)
            evaluations += 1
            trial_cost = evaluated[2] + _away(trial, prior, information)
            if trial_cost <= cost * (1 + 1e-12):
                value, cost = trial, trial_cost
                curvature, slope, chi_square = evaluated
                break
            step = step / 2
        else:
            break
        converged = size < tolerance
    return Solution(
        value,
        np.asarray(np.linalg.inv(information + curvature), dtype=np.float64),
        chi_square,
        iterations,
        evaluations,
        (value <= lower) | (value >= upper),
        converged,
    )


def _evaluate(model: Model, value: F64) -> tuple[F64, F64, float]:
    evaluated = model(value)
    if not math.isfinite(evaluated[2]):
        raise ValueError(f"residual is not finite at {value.tolist()}")
    return evaluated


def _away(value: F64, prior: F64, information: F64) -> float:
    """Arrival cost."""
    away = value - prior
    return float(away @ information @ away)


@numba.njit(cache=True)
def _step(curvature, slope, information, prior, value, lower, upper):  # type: ignore[no-untyped-def]
    """Minimiser of the quadratic model inside the box, and its length in standard deviations.

    Active set: what leaves the box is fixed on its bound, the rest solved again. The length is nan
    where the quadratic model has no minimum.
    """
    n = value.shape[0]
    normal = information + curvature
    gradient = slope.copy()
    for i in range(n):
        for j in range(n):
            gradient[i] += information[i, j] * (value[j] - prior[j])
    step = np.zeros(n)
    free = np.ones(n, dtype=np.bool_)
    for _ in range(n + 1):
        chosen = np.nonzero(free)[0]
        m = chosen.shape[0]
        if m == 0:
            break
        matrix = np.empty((m, m))
        rhs = np.empty(m)
        for a in range(m):
            i = chosen[a]
            rhs[a] = -gradient[i]
            for j in range(n):
                if not free[j]:
                    rhs[a] -= normal[i, j] * step[j]
            for b in range(m):
                matrix[a, b] = normal[i, chosen[b]]
        if not _cholesky_solve(matrix, rhs):
            return step, math.nan
        outside = False
        for a in range(m):
            i = chosen[a]
            step[i] = rhs[a]
            low, high = lower[i] - value[i], upper[i] - value[i]
            if step[i] < low or step[i] > high:
                step[i] = min(max(step[i], low), high)
                free[i] = False
                outside = True
        if not outside:
            break
    size = 0.0
    for i in range(n):
        for j in range(n):
            size += step[i] * normal[i, j] * step[j]
    return step, math.sqrt(max(size, 0.0))


@numba.njit(cache=True)
def _cholesky_solve(matrix, rhs):  # type: ignore[no-untyped-def]
    """Solve a positive definite system in place; False where it is not positive definite."""
    n = rhs.shape[0]
    for j in range(n):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] ** 2
        if not pivot > 0.0:
            return False
        pivot = math.sqrt(pivot)
        matrix[j, j] = pivot
        for i in range(j + 1, n):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry / pivot
    for i in range(n):
        for k in range(i):
            rhs[i] -= matrix[i, k] * rhs[k]
        rhs[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            rhs[i] -= matrix[k, i] * rhs[k]
        rhs[i] /= matrix[i, i]
    return True
