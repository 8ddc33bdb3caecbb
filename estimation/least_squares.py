"""Parts of a bounded Gauss-Newton with an arrival cost, compiled; equation (4) of the source paper.

Minimises  |p - prior|^2 in P^-1  +  sum r_k(p)^2 / R_k  with  lower <= p <= upper. Few unknowns,
many samples: the problem is known by its normal equations, each step is a quadratic problem in a
box, solved by an active set. The loop around it belongs to the problem (`window`).
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def gauss_newton_step(  # type: ignore[no-untyped-def]
    curvature, slope, information, prior, value, lower, upper
):
    """Minimiser of the quadratic model inside the box, and its length in standard deviations.

    `curvature` and `slope` are J'J, shape (n, n), and J'r, shape (n,), of the whitened residual at
    `value`; `information` is P^-1. What leaves the box is fixed on its bound, the rest solved
    again. The length is nan where the quadratic model has no minimum.
    """
    n = value.shape[0]
    normal = information + curvature
    gradient = slope.copy()
    for i in range(n):
        for j in range(n):
            gradient[i] += information[i, j] * (value[j] - prior[j])
    step = np.empty(n)
    factor = normal.copy()
    if not _factor(factor):
        step[:] = 0.0
        return step, math.nan
    inside = True
    for i in range(n):
        step[i] = -gradient[i]
    _substitute(factor, step)
    for i in range(n):
        inside = inside and lower[i] - value[i] <= step[i] <= upper[i] - value[i]
    if not inside and not _active_set(normal, gradient, value, lower, upper, step):
        step[:] = 0.0
        return step, math.nan
    size = 0.0
    for i in range(n):
        for j in range(n):
            size += step[i] * normal[i, j] * step[j]
    return step, math.sqrt(max(size, 0.0))


@numba.njit(cache=True)
def cholesky_inverse(matrix):  # type: ignore[no-untyped-def]
    """Invert a positive definite matrix in place; False (and undefined) where it is not."""
    n = matrix.shape[0]
    factor = matrix.copy()
    if not _factor(factor):
        return False
    column = np.empty(n)
    for j in range(n):
        for i in range(n):
            column[i] = 1.0 if i == j else 0.0
        _substitute(factor, column)
        for i in range(n):
            matrix[i, j] = column[i]
    return True


@numba.njit(cache=True)
def _factor(matrix):  # type: ignore[no-untyped-def]
    """Cholesky factor in the lower triangle; False where the matrix is not positive definite."""
    n = matrix.shape[0]
    for j in range(n):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        if not pivot > 0.0:
            return False
        pivot = math.sqrt(pivot)
        matrix[j, j] = pivot
        for i in range(j + 1, n):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry / pivot
    return True


@numba.njit(cache=True)
def _substitute(factor, rhs):  # type: ignore[no-untyped-def]
    """Solve with a Cholesky factor, in place."""
    n = rhs.shape[0]
    for i in range(n):
        for k in range(i):
            rhs[i] -= factor[i, k] * rhs[k]
        rhs[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            rhs[i] -= factor[k, i] * rhs[k]
        rhs[i] /= factor[i, i]


@numba.njit(cache=True)
def _active_set(normal, gradient, value, lower, upper, step):  # type: ignore[no-untyped-def]
    """Fill the step that stays in the box; False where there is no minimum."""
    n = value.shape[0]
    step[:] = 0.0
    free = np.ones(n, dtype=np.bool_)
    for _ in range(4 * n):
        chosen = np.nonzero(free)[0]
        m = chosen.shape[0]
        matrix, rhs = np.empty((m, m)), np.empty(m)
        for a in range(m):
            i = chosen[a]
            rhs[a] = -gradient[i]
            for j in range(n):
                if not free[j]:
                    rhs[a] -= normal[i, j] * step[j]
            for b in range(m):
                matrix[a, b] = normal[i, chosen[b]]
        if not _factor(matrix):
            return False
        _substitute(matrix, rhs)
        # The one that leaves the box farthest is fixed on its bound ...
        worst, excess = -1, 0.0
        for a in range(m):
            i = chosen[a]
            step[i] = rhs[a]
            beyond = max(lower[i] - value[i] - step[i], step[i] - upper[i] + value[i])
            if beyond > excess:
                worst, excess = i, beyond
        if worst >= 0:
            step[worst] = min(max(step[worst], lower[worst] - value[worst]),
                              upper[worst] - value[worst])  # fmt: skip
            free[worst] = False
            continue
        # ... and one that the slope would pull off its bound into the box is freed again.
        pulled, pull = -1, 0.0
        for i in range(n):
            if not free[i]:
                rise = gradient[i]
                for j in range(n):
                    rise += normal[i, j] * step[j]
                inward = -rise if step[i] <= lower[i] - value[i] else rise
                if inward > pull * (1.0 + 1e-9) + 1e-12 * abs(gradient[i]):
                    pulled, pull = i, inward
        if pulled < 0:
            break
        free[pulled] = True
    return True
