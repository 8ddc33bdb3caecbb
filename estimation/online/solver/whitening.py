"""Weights of the residual's rows, and the normal equations under them.

Row k is off by what the encoder adds to its three positions and by what the force adds:

    (m/T^2 - c/2T) e[k-1] + (kappa_k - 2m/T^2) e[k] + (m/T^2 + c/2T) e[k+1] + white_k

with kappa_k the stiffness of the elements that stick there and c the viscous coefficient. The
covariance has a band of five and is factored row by row, L D L'. At low frequencies, where the
second difference hides the encoder, kappa is what is left of it: without it the presliding
stiffness is weighed wrongly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stagedata import F64
from stagedata.compiled import kernel


class Weights(NamedTuple):
    """The rows' covariance, factored as L D L'.

    Attributes:
        first: what is below the diagonal of L, shape (K,).
        second: what is below that, shape (K,).
        inverse: of D [1/N^2], 0 for rows that do not count, shape (K,).
    """

    first: F64
    second: F64
    inverse: F64


@kernel()
def make_weights(count):  # type: ignore[no-untyped-def]
    """Workspace for `count` rows."""
    return Weights(np.zeros(count), np.zeros(count), np.zeros(count))


@kernel()
def weigh_apart(white, use, weights):  # type: ignore[no-untyped-def]
    """Weights of single rows, as if the encoder were exact; arguments as `factor_weights`."""
    for k in range(use.shape[0]):
        weights.first[k] = weights.second[k] = 0.0
        weights.inverse[k] = 1.0 / white[k] if use[k] else 0.0


@kernel()
def factor_weights(mass, viscous, period, noise, spring, white, use, weights):  # type: ignore[no-untyped-def]
    """Factor the rows' covariance.

    Args:
        mass: of the residual [kg].
        viscous: coefficient [N s/m].
        period: of the samples [s].
        noise: rms of a position [m].
        spring: stiffness of what sticks at each row [N/m], shape (K,).
        white: variance of the force at each row [N^2], shape (K,).
        use: rows that count, shape (K,).
        weights: written.
    """
    before = noise * (mass / period**2 - 0.5 * viscous / period)
    after = noise * (mass / period**2 + 0.5 * viscous / period)
    here_last = weight = weight_last = first = 0.0
    for k in range(use.shape[0]):
        here = noise * spring[k] - before - after
        if use[k]:
            # The first position's error is an unknown of its own.
            variance = after * after + here * here + white[k] + (before * before if k > 0 else 0.0)
            with_last = before * here_last + here * after - before * after * first
            first, second = with_last * weight, before * after * weight_last
            variance -= first * with_last + second * before * after
            weight_last, weight = weight, 1.0 / variance
        else:
            first = second = 0.0
            weight_last, weight = weight, 0.0
        here_last = here
        weights.first[k], weights.second[k], weights.inverse[k] = first, second, weight


@kernel(fastmath={"contract"})
def whiten(columns, chosen, weights):  # type: ignore[no-untyped-def]
    """Take out of every chosen column, shape (*, K), what earlier rows explain, in place."""
    first, second = weights.first, weights.second
    for a in range(chosen.shape[0]):
        column = columns[chosen[a]]
        last = before = 0.0
        for k in range(column.shape[0]):
            this = column[k] - second[k] * before - first[k] * last
            column[k] = this
            before, last = last, this


@kernel()
def unwhiten(column, weights):  # type: ignore[no-untyped-def]
    """Undo `whiten` for one column, shape (K,), in place."""
    last = before = 0.0
    for k in range(column.shape[0]):
        this = column[k]
        column[k] = this + weights.second[k] * before + weights.first[k] * last
        before, last = last, this


@kernel()
def normal_equations(columns, chosen, weights, normal):  # type: ignore[no-untyped-def]
    """Weighted products of the chosen whitened columns, shape (n, n), both triangles."""
    for a in range(chosen.shape[0]):
        for b in range(a + 1):
            normal[a, b] = normal[b, a] = _dot(
                weights.inverse, columns[chosen[a]], columns[chosen[b]]
            )


@kernel(fastmath={"reassoc", "contract"})
def _dot(weight, a, b):  # type: ignore[no-untyped-def]
    """Weighted product of two columns, shape (K,)."""
    total = 0.0
    for k in range(weight.shape[0]):
        total += weight[k] * a[k] * b[k]
    return total
