"""Parts of a bounded Gauss-Newton with an arrival cost, compiled; equation (4) of the source paper.

Minimises  |p - prior|^2 in P^-1  +  sum r_k(p)^2 / R_k  with  lower <= p <= upper. Few unknowns,
many samples: the problem is known by its normal equations, each step is a quadratic problem in a
box, solved by an active set. The loop around it belongs to the problem.
"""

from __future__ import annotations

import math

import numpy as np

from stagedata.compiled import kernel


@kernel()
def gauss_newton_step(  # type: ignore[no-untyped-def]
    curvature, slope, information, prior, value, lower, upper
):
    """`gauss_newton_into` that returns a new step, shape (n,), and its length."""
    step = np.empty(value.shape[0])
    length = gauss_newton_into(curvature, slope, information, prior, value, lower, upper, step)
    return step, length


@kernel()
def gauss_newton_into(  # type: ignore[no-untyped-def]
    curvature, slope, information, prior, value, lower, upper, step
):
    """Minimiser of the quadratic model inside the box; its length in standard deviations.

    What leaves the box is fixed on its bound, and the rest solved again.

    Args:
        curvature: J'J of the whitened residual at `value`, shape (>= n, >= n).
        slope: J'r there, shape (n,).
        information: P^-1 of the arrival cost, shape (n, n).
        prior: its mean, shape (n,).
        value: unknowns, shape (n,).
        lower: bounds of them, shape (n,).
        upper: the same.
        step: written, shape (n,).

    Returns:
        The length; nan, and no step, where the model has no minimum.
    """
    n = value.shape[0]
    gradient, normal, factor = np.empty(n), np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        rise = slope[i]
        for j in range(n):
            normal[i, j] = factor[i, j] = information[i, j] + curvature[i, j]
            rise += information[i, j] * (value[j] - prior[j])
        gradient[i], step[i] = rise, -rise
    sound = _factor(factor)
    if sound:
        inside = True
        _substitute(factor, step)
        for i in range(n):
            inside = inside and lower[i] - value[i] <= step[i] <= upper[i] - value[i]
        sound = inside or _active_set(normal, gradient, value, lower, upper, step)
    if not sound:
        for i in range(n):
            step[i] = 0.0
        return math.nan
    return math.sqrt(max(quadratic_form(normal, step), 0.0))


@kernel(fastmath={"contract"})
def quadratic_form(matrix, x):  # type: ignore[no-untyped-def]
    """X' M x, of the first n rows and columns of M, for x of shape (n,)."""
    total = 0.0
    for i in range(x.shape[0]):
        along = 0.0
        for j in range(x.shape[0]):
            along += matrix[i, j] * x[j]
        total += x[i] * along
    return total


@kernel(fastmath={"contract"})
def cholesky_inverse(matrix):  # type: ignore[no-untyped-def]
    """Invert a definite matrix, shape (n, n), in place; False, and undefined, where it is not."""
    n = matrix.shape[0]
    if not _factor(matrix):
        return False
    # The factor's inverse in its place, then the product of that with its transpose.
    for j in range(n):
        for i in range(j + 1, n):
            entry = 0.0
            for k in range(j, i):
                entry -= matrix[i, k] * matrix[k, j]
            matrix[i, j] = entry * matrix[i, i]
    for i in range(n):
        for j in range(i + 1):
            entry = 0.0
            for k in range(i, n):
                entry += matrix[k, i] * matrix[k, j]
            matrix[i, j] = matrix[j, i] = entry
    return True


@kernel(fastmath={"contract"})
def _factor(matrix):  # type: ignore[no-untyped-def]
    """Cholesky factor of (n, n) in the lower triangle, diagonal inverted; False: not definite."""
    n = matrix.shape[0]
    for i in range(n):
        for j in range(i):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry * matrix[j, j]
        pivot = matrix[i, i]
        for k in range(i):
            pivot -= matrix[i, k] * matrix[i, k]
        if not pivot > 0.0:
            return False
        matrix[i, i] = 1.0 / math.sqrt(pivot)
    return True


@kernel(fastmath={"contract"})
def _substitute(factor, rhs):  # type: ignore[no-untyped-def]
    """Solve with a Cholesky factor, shape (n, n), in place of `rhs`, shape (n,)."""
    n = rhs.shape[0]
    for i in range(n):
        entry = rhs[i]
        for k in range(i):
            entry -= factor[i, k] * rhs[k]
        rhs[i] = entry * factor[i, i]
    for i in range(n - 1, -1, -1):
        rhs[i] *= factor[i, i]
        for k in range(i):
            rhs[k] -= factor[i, k] * rhs[i]


@kernel()
def _active_set(normal, gradient, value, lower, upper, step):  # type: ignore[no-untyped-def]
    """Write the step that stays in the box, shape (n,); False where there is no minimum."""
    n = value.shape[0]
    free, chosen = np.empty(n, dtype=np.bool_), np.empty(n, dtype=np.int64)
    for i in range(n):
        free[i], step[i] = True, 0.0
    for _ in range(4 * n):
        m = n - n
        for i in range(n):
            if free[i]:
                chosen[m] = i
                m += 1
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
