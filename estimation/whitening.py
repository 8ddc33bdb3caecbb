"""Weights of the residual's rows, and the normal equations under them.

Row k is off by what the encoder adds to its three positions and by what the force adds:

    (m/T^2 - c/2T) e[k-1] + (kappa_k - 2m/T^2) e[k] + (m/T^2 + c/2T) e[k+1] + white_k

with kappa_k the stiffness of the elements that stick there and c the viscous coefficient. The
covariance has a band of five and is factored row by row, L D L'. At low frequencies, where the
second difference hides the encoder, kappa is what is left of it: without it the presliding
stiffness is weighed wrongly.

Rounding of the force is white noise only where the force runs through many codes in no order. Else
its error is a sawtooth of the force itself, of unknown phase: its harmonics cos and sin of
2 pi n u/step have a variance of step^2/(2 (pi n)^2) each. The rows are weighed as if it were white,
but what is said of the estimate's covariance takes the harmonics into account
(`rounding_covariance`): on a plateau the error does not average out, on a slope it does better.
"""

from __future__ import annotations

import math

import numba
import numpy as np

HARMONICS = 8
"""Of the rounding error that are told from white noise."""
NEAREST = 1.5 * 2.0**52
"""Added and taken away again it rounds to the nearest whole number."""
SINE = tuple((-1.0) ** j / math.factorial(2 * j + 1) for j in range(10, -1, -1))
COSINE = tuple((-1.0) ** j / math.factorial(2 * j) for j in range(11, -1, -1))
"""Taylor series of sin x / x and cos x in x^2, highest power first; exact up to pi/2."""
SMOOTHING = 6
"""The predicted force is smoothed over so many samples to either side, for its phase only."""


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


@numba.njit(cache=True, error_model="numpy")
def _parabola(reach, j):  # type: ignore[no-untyped-def]
    """Weight of the sample j places off in a least-squares parabola over 2 reach + 1, middle."""
    n = reach * (reach + 1.0)
    return 3.0 * (3.0 * n - 1.0 - 5.0 * j * j) / ((2.0 * reach + 1.0) * max(4.0 * n - 3.0, 1.0))


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _series(x, factors):  # type: ignore[no-untyped-def]
    total = 0.0
    for factor in factors:
        total = total * x + factor
    return total


@numba.njit(cache=True, error_model="numpy")
def add_harmonics(residual, force, step, count, columns):  # type: ignore[no-untyped-def]
    """Fill cosines and sines of the multiples 0... of the predicted force over the rounding step.

    Args:
        residual: predicted minus measured force, shape (>= K,). The prediction is smoothed here:
            its noise is that of the positions, not of the force.
        force: measured, from the sample before the first row on, shape (>= K + 2,).
        step: of the rounding [N].
        count: K.
        columns: written, shape (2 HARMONICS + 2, >= K).
    """
    predicted, smooth, cosine, sine = columns[0], columns[1], columns[2], columns[3]
    for k in range(count):
        predicted[k] = (residual[k] + force[k + 1]) / step
        smooth[k] = 0.0
    inside = count - 2 * SMOOTHING
    for j in range(2 * SMOOTHING + 1 if inside > 0 else 0):
        weight = _parabola(SMOOTHING, j - SMOOTHING)
        for k in range(inside):
            smooth[k + SMOOTHING] += weight * predicted[k + j]
    for k in range(count):
        reach = min(SMOOTHING, k, count - 1 - k)
        if reach == 0:
            smooth[k] = predicted[k]
        elif reach < SMOOTHING:
            for j in range(-reach, reach + 1):
                smooth[k] += _parabola(reach, j) * predicted[k + j]
    # Straight code, for vector units: half of an angle of up to half a turn, doubled.
    for k in range(count):
        turns = smooth[k] - ((smooth[k] + NEAREST) - NEAREST)
        half = math.pi * turns
        sine_of_half = half * _series(half * half, SINE)
        cosine[k] = 1.0 - 2.0 * sine_of_half * sine_of_half
        sine[k] = 2.0 * sine_of_half * _series(half * half, COSINE)
    twice = np.empty(count)
    for k in range(count):
        twice[k] = 2.0 * cosine[k]
        predicted[k], smooth[k] = 1.0, 0.0
    for j in range(4, columns.shape[0]):
        for k in range(count):
            columns[j, k] = twice[k] * columns[j - 2, k] - columns[j - 4, k]


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def rounding_covariance(  # type: ignore[no-untyped-def]
    columns, chosen, weights, residual, force, step, rest, weight, kept, covariance
):
    """Correct in place a covariance that took rounding errors for white.

    With M the covariance, J the whitened columns, C the true covariance of the rounding error and
    C_0 the white one, it becomes M + G (C - C_0) G', G = M J' W: the sandwich.

    Args:
        columns: whitened, of which `chosen` are the unknowns', shape (*, K).
        chosen: shape (n,).
        weights: of `factor_weights`: lower, lowest, inverse, shape (>= 3, K).
        residual: of `add_harmonics`, shape (>= K,).
        force: the same.
        step: of the rounding [N].
        rest: which of the unknowns is the force at rest before the move, known from a measured
            force that is rounded as the first row is.
        weight: of that knowledge [1/N^2].
        kept: of which of the unknowns the covariance is wanted; the rest is left, shape (m,).
        covariance: shape (n, n).
    """
    count, n, m = columns.shape[1], chosen.shape[0], kept.shape[0]
    lower, lowest, inverse = weights[0], weights[1], weights[2]
    # One place more: the error of the force at rest, which is that of the first row.
    harmonics, gain = np.empty((2 * HARMONICS + 2, count + 1)), np.zeros((m, count + 1))
    add_harmonics(residual, force, step, count, harmonics)
    for h in range(harmonics.shape[0]):
        harmonics[h, count] = harmonics[h, 0]
    for a in range(m):
        row = gain[a]
        for b in range(n):
            share, column = covariance[kept[a], b], columns[chosen[b]]
            for k in range(count):
                row[k] += share * column[k]
        for k in range(count):
            row[k] *= inverse[k]
        row[count] = covariance[kept[a], rest] * weight
    _unwhiten(gain, count, lower, lowest)
    white = 0.0
    for j in range(HARMONICS):
        white += 0.5 * (step / (math.pi * (j + 1))) ** 2
    order = np.arange(max(2 * HARMONICS + 2, m))
    seen, common = np.empty((m, 2 * HARMONICS)), np.empty(m)
    for a in range(m):
        products(gain[a], harmonics, order[2:], 2 * HARMONICS, seen[a])
        products(gain[a], gain, order, a + 1, common)
        for b in range(a + 1):
            total = -white * common[b]
            for h in range(2 * HARMONICS):
                variance = 0.5 * (step / (math.pi * (h // 2 + 1))) ** 2
                total += variance * seen[a, h] * seen[b, h]
            covariance[kept[a], kept[b]] += total
            if b < a:
                covariance[kept[b], kept[a]] += total


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _unwhiten(rows, count, lower, lowest):  # type: ignore[no-untyped-def]
    """Solve with the transpose of L, in place, over the first `count` places of every row."""
    n = rows.shape[0]
    for j in range(0, n, 4):  # the last ones may come twice
        a, b = rows[j], rows[min(j + 1, n - 1)]
        c, d = rows[min(j + 2, n - 1)], rows[min(j + 3, n - 1)]
        a1 = a2 = b1 = b2 = c1 = c2 = d1 = d2 = first = second = third = 0.0
        for k in range(count - 1, -1, -1):
            a0 = (a[k] - second * a2) - first * a1
            b0 = (b[k] - second * b2) - first * b1
            c0 = (c[k] - second * c2) - first * c1
            d0 = (d[k] - second * d2) - first * d1
            a[k], b[k], c[k], d[k] = a0, b0, c0, d0
            a2, a1, b2, b1, c2, c1, d2, d1 = a1, a0, b1, b0, c1, c0, d1, d0
            first, second, third = lower[k], third, lowest[k]
