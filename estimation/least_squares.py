"""Bounded Gauss-Newton with an arrival cost; equation (4) of the source paper.

Minimises  |p - prior|^2 in P^-1  +  sum r_k(p)^2 / R_k  with  lower <= p <= upper.
Few unknowns, many samples; bounds by an active set on each step; halved steps where the cost rises.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

Model = Callable[[F64], tuple[F64, F64, float]]
"""Unknowns, shape (n,) -> normal equations of the whitened residual r with Jacobian J:
J'J, shape (n, n), J'r, shape (n,), and r'r."""


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
    tolerance: float = 0.02,
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
    """
    value = np.clip(prior if guess is None else guess, lower, upper)
    curvature, slope, chi_square = _evaluate(model, value)
    cost = chi_square + _away(value, prior, information)
    evaluations, iterations, converged = 1, 0, False
    while iterations < max_iterations and not converged:
        iterations += 1
        normal = information + curvature
        gradient = information @ (value - prior) + slope
        step = _bounded_step(normal, gradient, lower - value, upper - value)
        size = float(np.sqrt(step @ normal @ step))
        for _ in range(6):
            trial = np.clip(value + step, lower, upper)
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
    at_bound = (value <= lower) | (value >= upper)
    covariance = np.asarray(np.linalg.inv(information + curvature), dtype=np.float64)
    return Solution(
        value,
        covariance,
        chi_square,
        iterations,
        evaluations,
        at_bound,
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


def _bounded_step(normal: F64, gradient: F64, lowest: F64, highest: F64) -> F64:
    """Minimiser of the quadratic model inside a box: fix what leaves it on its bound, repeat."""
    step = np.asarray(np.linalg.solve(normal, -gradient), dtype=np.float64)
    if ((step >= lowest) & (step <= highest)).all():
        return step
    step = np.zeros_like(gradient)
    free = np.ones(len(gradient), dtype=np.bool_)
    for _ in range(len(gradient) + 1):
        if not free.any():
            break
        rhs = -(gradient[free] + normal[np.ix_(free, ~free)] @ step[~free])
        step[free] = np.linalg.solve(normal[np.ix_(free, free)], rhs)
        outside = free & ((step < lowest) | (step > highest))
        if not outside.any():
            break
        step[outside] = np.clip(step[outside], lowest[outside], highest[outside])
        free &= ~outside
    return step
