"""Least-squares sums of a residual with correlated noise: whitening by a banded Cholesky factor.

The encoder's noise enters the residual through the second difference of position, so neighbouring
residuals share it: its covariance has the bands 6, -4, 1. Force noise and model error are white.
Shapes: M samples, n columns of the Jacobian.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stagedata import F64
from stagedata.compiled import kernel


class _Factor(NamedTuple):
    """Cholesky factor of the covariance, row by row, shapes (M,); a pivot of 0: not used.

    `first`, `second`: entries one and two columns left of the pivot [N].
    """

    pivot: F64
    first: F64
    second: F64


@kernel()
def sum_whitened(rows, used, encoder, white, column, scale):  # type: ignore[no-untyped-def]
    """J'J, J'r, r'r and number of samples, whitened.

    With errors in variables, column `column` has the residual's encoder noise: it is the derivative
    by the mass, the measured acceleration. The part of the noise that the residual shows is taken
    out of it (in `rows`). It becomes the derivative at the most probable positions.

    Args:
        rows: Jacobian, and the residual [N] as last column, shape (M, n + 1).
        used: samples that count, shape (M,); first and last do not. Residuals on both sides of a
            gap are taken as independent.
        encoder: variance of the residual by one position, (m sigma / T^2)^2 [N^2].
        white: that of force noise and model error [N^2].
        column: with errors in variables; -1: without.
        scale: of that column's unknown, relative to the mass.

    Returns:
        J'J, shape (n, n); J'r, shape (n,); chi-square; number of samples.
    """
    factor = _factorise(used, encoder, white)
    if column >= 0:
        _remove_noise(rows, factor, encoder * scale, column)
    return _sum(rows, factor)


@kernel()
def _factorise(used, encoder, white):  # type: ignore[no-untyped-def]
    """`_Factor` of the covariance; `used`, shape (M,)."""
    count = used.shape[0]
    diagonal = 6.0 * encoder + white
    factor = _Factor(np.zeros(count), np.zeros(count), np.zeros(count))
    pivot = pivot_before = 1.0
    first = 0.0
    run = 0  # samples since the last gap
    for k in range(1, count - 1):
        if not used[k]:
            run = 0
            continue
        second = encoder / pivot_before if run > 1 else 0.0
        first = (-4.0 * encoder - second * first) / pivot if run > 0 else 0.0
        pivot_before = pivot
        pivot = math.sqrt(diagonal - first * first - second * second)
        factor.pivot[k], factor.first[k], factor.second[k] = pivot, first, second
        run += 1
    return factor


@kernel()
def _sum(rows, factor):  # type: ignore[no-untyped-def]
    """As `sum_whitened`, under the `_Factor`."""
    count, width = rows.shape
    n = width - 1
    normal, slope = np.zeros((n, n)), np.zeros(n)
    this, last, older = np.zeros(width), np.zeros(width), np.zeros(width)
    chi = 0.0
    samples = 0
    for k in range(1, count - 1):
        pivot, first, second = factor.pivot[k], factor.first[k], factor.second[k]
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
def _remove_noise(rows, factor, variance, column):  # type: ignore[no-untyped-def]
    """Column `column` of `rows`, shape (M, n + 1), less D S^-1 r times `variance`.

    S is the covariance, r the residual, D the second difference of second differences.
    """
    count, n = rows.shape[0], rows.shape[1] - 1
    solved = np.zeros(count)  # S^-1 r
    last = older = 0.0
    for k in range(1, count - 1):
        if factor.pivot[k] > 0.0:
            own = rows[k, n] - factor.first[k] * last - factor.second[k] * older
            solved[k] = own / factor.pivot[k]
            older, last = last, solved[k]
    for k in range(count - 2, 0, -1):
        if factor.pivot[k] > 0.0:
            after = factor.first[k + 1] * solved[k + 1]
            later = factor.second[k + 2] * solved[k + 2] if k + 2 < count else 0.0
            solved[k] = (solved[k] - after - later) / factor.pivot[k]
    for k in range(2, count - 2):
        if factor.pivot[k] > 0.0:
            ends, inner = solved[k - 2] + solved[k + 2], solved[k - 1] + solved[k + 1]
            rows[k, column] -= variance * (ends - 4.0 * inner + 6.0 * solved[k])
