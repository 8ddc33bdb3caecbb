"""Weights of the residual's rows, and the normal equations under them.

Row k is off by what the encoder adds to its three positions and by what the force adds:

    (m/T^2 - c/2T) e[k-1] + (kappa_k - 2m/T^2) e[k] + (m/T^2 + c/2T) e[k+1] + white_k

with kappa_k the stiffness of the elements that stick there and c the viscous coefficient. The
covariance has a band of five and is factored row by row, L D L'. At low frequencies, where the
second difference hides the encoder, kappa is what is left of it: without it the presliding
stiffness is weighed wrongly.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, error_model="numpy")
def factor_weights(  # type: ignore[no-untyped-def]
    mass, viscous, period, noise, stuck, white, use, lower, lowest, inverse
):
    """Factor the rows' covariance: L has ones, `lower` and `lowest` beside them, D is 1/`inverse`.

    Args:
        mass: of the residual [kg].
        viscous: coefficient [N s/m].
        period: of the samples [s].
        noise: rms of a position [m].
        stuck: stiffness of what sticks at each row [N/m], shape (K,).
        white: variance of the force at each row [N^2], shape (K,).
        use: rows that count; the others have no weight, shape (K,).
        lower: written, shape (K,).
        lowest: written, shape (K,).
        inverse: written, shape (K,).
    """
    before = noise * (mass / period**2 - 0.5 * viscous / period)
    after = noise * (mass / period**2 + 0.5 * viscous / period)
    outer = before * before + after * after
    c2 = before * after
    here_last = 0.0
    weight = weight_last = off = 0.0
    same = -1
    for k in range(use.shape[0]):
        # The first position's error is an unknown of its own.
        edge = before * before if k == 0 else 0.0
        here = noise * stuck[k] - before - after
        if not use[k]:
            lower[k] = lowest[k] = inverse[k] = 0.0
            weight, weight_last, off, here_last = 0.0, weight, 0.0, here
            same = -1
            continue
        if same >= 0 and here == here_last and white[k] == white[k - 1]:
            if same > 2 and abs(weight - weight_last) <= 1e-9 * weight:
                lower[k], lowest[k], inverse[k] = lower[k - 1], lowest[k - 1], inverse[k - 1]
                continue
            same += 1
        else:
            same = 0
        c1 = before * here_last + here * after
        first = (c1 - c2 * off) * weight
        second = c2 * weight_last
        variance = outer - edge + here * here + white[k] - first * (c1 - c2 * off) - second * c2
        weight_last, weight = weight, 1.0 / variance
        off, here_last = first, here
        lower[k], lowest[k], inverse[k] = first, second, weight


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def whiten(columns, chosen, lower, lowest):  # type: ignore[no-untyped-def]
    """Take out of every chosen column what earlier rows explain, in place."""
    count = columns.shape[1]
    n = chosen.shape[0]
    # Three at a time, because each step waits for the one before; the last ones may come twice.
    for j in range(0, n, 3):
        a = columns[chosen[j]]
        b = columns[chosen[min(j + 1, n - 1)]]
        c = columns[chosen[min(j + 2, n - 1)]]
        a1 = a2 = b1 = b2 = c1 = c2 = 0.0
        for k in range(count):
            first, second = lower[k], lowest[k]
            a0 = (a[k] - second * a2) - first * a1
            b0 = (b[k] - second * b2) - first * b1
            c0 = (c[k] - second * c2) - first * c1
            a[k], b[k], c[k] = a0, b0, c0
            a2, a1, b2, b1, c2, c1 = a1, a0, b1, b0, c1, c0


@numba.njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _dots(a, b0, b1, b2, b3):  # type: ignore[no-untyped-def]
    """Products of one row with four: what is loaded once serves four sums."""
    t0 = t1 = t2 = t3 = 0.0
    for k in range(a.shape[0]):
        t0 += a[k] * b0[k]
        t1 += a[k] * b1[k]
        t2 += a[k] * b2[k]
        t3 += a[k] * b3[k]
    return t0, t1, t2, t3


@numba.njit(cache=True, error_model="numpy")
def products(row, columns, chosen, n, out):  # type: ignore[no-untyped-def]
    """Products of a row with the first n chosen columns, shape (>= n,)."""
    for j in range(0, n, 4):
        j1, j2, j3 = min(j + 1, n - 1), min(j + 2, n - 1), min(j + 3, n - 1)
        out[j], out[j1], out[j2], out[j3] = _dots(
            row, columns[chosen[j]], columns[chosen[j1]], columns[chosen[j2]], columns[chosen[j3]]
        )


@numba.njit(cache=True, error_model="numpy")
def normal_equations(columns, chosen, inverse, normal):  # type: ignore[no-untyped-def]
    """Weighted products of all chosen whitened columns, shape (n, n), both triangles."""
    n, count = chosen.shape[0], columns.shape[1]
    weighted = np.empty(count)
    for i in range(n):
        a = columns[chosen[i]]
        for k in range(count):
            weighted[k] = a[k] * inverse[k]
        products(weighted, columns, chosen, i + 1, normal[i])
        for j in range(i):
            normal[j, i] = normal[i, j]
