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


@numba.njit(cache=True, error_model="numpy")
def whiten(columns, chosen, lower, lowest):  # type: ignore[no-untyped-def]
    """Take out of every chosen column what earlier rows explain, in place."""
    count = columns.shape[1]
    n = chosen.shape[0]
    j = 0
    while j + 1 < n:
        a, b = columns[chosen[j]], columns[chosen[j + 1]]
        a1 = a2 = b1 = b2 = 0.0
        for k in range(count):
            first, second = lower[k], lowest[k]
            a0 = (a[k] - second * a2) - first * a1
            b0 = (b[k] - second * b2) - first * b1
            a[k], b[k] = a0, b0
            a2, a1, b2, b1 = a1, a0, b1, b0
        j += 2
    if j < n:
        a = columns[chosen[j]]
        a1 = a2 = 0.0
        for k in range(count):
            a0 = (a[k] - lowest[k] * a2) - lower[k] * a1
            a[k] = a0
            a2, a1 = a1, a0


@numba.njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _dot(a, b, weight):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k] * b[k] * weight[k]
    return total


@numba.njit(cache=True, error_model="numpy")
def normal_equations(columns, chosen, inverse, normal):  # type: ignore[no-untyped-def]
    """Weighted products of all chosen whitened columns, shape (n, n), both triangles."""
    n = chosen.shape[0]
    for i in range(n):
        a = columns[chosen[i]]
        for j in range(i + 1):
            normal[i, j] = normal[j, i] = _dot(a, columns[chosen[j]], inverse)


@numba.njit(cache=True, error_model="numpy")
def add_harmonics(residual, force, step, columns):  # type: ignore[no-untyped-def]
    """Fill cosines and sines of the predicted force over the rounding step.

    Args:
        residual: predicted minus measured force, shape (>= K,). The prediction is smoothed here:
            its noise is that of the positions, not of the force.
        force: measured, from the sample before the first row on, shape (>= K + 2,).
        step: of the rounding [N].
        columns: written, shape (2 HARMONICS, K).
    """
    count = columns.shape[1]
    for k in range(count):
        reach = min(SMOOTHING, k, count - 1 - k)
        # Least-squares parabola over 2 reach + 1 samples, at its middle.
        n = reach * (reach + 1.0)
        scale = 3.0 / ((2.0 * reach + 1.0) * max(4.0 * n - 3.0, 1.0))
        smooth = 0.0
        if reach == 0:
            smooth = residual[k] + force[k + 1]
        else:
            for j in range(-reach, reach + 1):
                weight = scale * (3.0 * n - 1.0 - 5.0 * j * j)
                smooth += weight * (residual[k + j] + force[k + j + 1])
        angle = 2.0 * math.pi * (smooth / step)
        c1, s1 = math.cos(angle), math.sin(angle)
        c, s = c1, s1
        for j in range(HARMONICS):
            columns[2 * j, k], columns[2 * j + 1, k] = c, s
            c, s = c * c1 - s * s1, s * c1 + c * s1


@numba.njit(cache=True, error_model="numpy")
def rounding_covariance(  # type: ignore[no-untyped-def]
    columns, chosen, weights, residual, force, step, rest, weight, covariance
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
        covariance: shape (n, n).
    """
    count, n = columns.shape[1], chosen.shape[0]
    lower, lowest, inverse = weights[0], weights[1], weights[2]
    harmonics = np.empty((2 * HARMONICS, count))
    add_harmonics(residual, force, step, harmonics)
    # J' W as rows, unwhitened: what multiplies an error of the force.
    gain = np.empty((n, count))
    change, seen = np.empty((n, n)), np.empty((2 * HARMONICS, n))
    for a in range(n):
        column, row = columns[chosen[a]], gain[a]
        after = later = 0.0
        for k in range(count - 1, -1, -1):
            value = column[k] * inverse[k]
            if k + 1 < count:
                value -= lower[k + 1] * after
            if k + 2 < count:
                value -= lowest[k + 2] * later
            row[k] = value
            after, later = value, after
        for h in range(2 * HARMONICS):
            harmonic = harmonics[h]
            total = weight * harmonic[0] if a == rest else 0.0
            for k in range(count):
                total += row[k] * harmonic[k]
            seen[h, a] = total
    white = 0.0
    for j in range(HARMONICS):
        white += 0.5 * (step / (math.pi * (j + 1))) ** 2
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for k in range(count):
                total += gain[a, k] * gain[b, k]
            total *= -white
            for h in range(2 * HARMONICS):
                variance = 0.5 * (step / (math.pi * (h // 2 + 1))) ** 2
                total += variance * seen[h, a] * seen[h, b]
            change[a, b] = change[b, a] = total
    change[rest, rest] -= white * weight * weight
    half = np.empty((n, n))
    for a in range(n):
        for b in range(n):
            total = 0.0
            for c in range(n):
                total += covariance[a, c] * change[c, b]
            half[a, b] = total
    for a in range(n):
        for b in range(n):
            total = 0.0
            for c in range(n):
                total += half[a, c] * covariance[c, b]
            change[a, b] = total
    for a in range(n):
        for b in range(n):
            covariance[a, b] += change[a, b]
