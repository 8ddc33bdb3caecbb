"""The solve that knows what positions' errors leave in slipping elements.

What is left fades at one rate (`carried_noise`), so a row less what is kept of the one before,

    y[k] = r[k] - keep[k] r[k-1],

is touched by the errors of four positions only: a covariance with a band of seven, exact, where
`whitening` takes for white noise of its sample what stays in the force behind it. It matters where
the force is known far better than what the encoder's noise does to a spring. One step, from a
solution that is a few standard deviations away at most.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.carried_noise import REACH, carry
from estimation.compiled import kernel
from estimation.least_squares import gauss_newton_step, quadratic_form
from estimation.move_tables import T_HAZE, T_SHARE, T_STUCK
from estimation.whitening import normal_equations


@kernel()
def refine_carried(  # type: ignore[no-untyped-def]
    raw, chosen, tables, heading, ready, use, mass, viscous, coulomb, stiffness, rate, alpha,
    shape, noise, period, start, known_coulomb, rest_force, white, shared, shares, prior,
    information, lower, upper, value, normal,
):  # fmt: skip
    """From the solution under `whitening` to the one under the covariance that positions have.

    Args:
        raw: residual and derivatives at the solution, not whitened, of which `chosen` are the
            unknowns' and, last, the residual, shape (*, K).
        chosen: shape (n + 1,).
        tables: of `rows.fill_rows`.
        heading: the same.
        ready: the same.
        use: rows that count, shape (K,).
        mass: of the residual [kg].
        viscous: coefficient [N s/m].
        coulomb: Fc [N].
        stiffness: sigma0 [N/m].
        rate: C/Fc [1/s].
        alpha: of the Stribeck curve.
        shape: Stribeck velocity [m/s] and exponent.
        noise: rms of a position [m].
        period: of the samples [s].
        start: element forces at rest before the move [N].
        known_coulomb: Coulomb force under which they are known [N].
        rest_force: measured there [N].
        white: variance of the force [N^2].
        shared: what it grows by, of `share_rounding` [N^2], shape (K,).
        shares: nu_i, shape (N,).
        prior: of `least_squares.gauss_newton_step`.
        information: the same.
        lower: the same.
        upper: the same.
        value: the solution; refined, shape (n,).
        normal: normal equations there, written, shape (n + 1, n + 1).
    """
    n, count = value.shape[0], use.shape[0]
    pull, keep, left = np.empty((REACH, count)), np.empty(count), np.empty(count)
    carry(
        coulomb, stiffness, rate, alpha, shape, noise, period, start, known_coulomb, rest_force,
        tables, heading, ready, shares, pull, keep, left,
    )  # fmt: skip
    factor = np.empty((REACH, count))
    factor_carried(
        mass, viscous, period, noise, white, shared, tables[T_STUCK], tables[T_SHARE],
        tables[T_HAZE], use, pull, keep, left, factor,
    )  # fmt: skip
    rows, order = np.empty((n + 1, count)), np.empty(n + 1, dtype=np.int8)
    for a in range(n + 1):
        order[a] = a
        for k in range(count):
            rows[a, k] = raw[chosen[a], k]
        whiten_carried(rows[a], keep, factor)
    normal_equations(rows, order, factor[0], normal)
    step, size = gauss_newton_step(
        normal[:n, :n], normal[:n, n], information, prior, value, lower, upper
    )
    if not math.isfinite(size):
        return
    normal[n, n] += quadratic_form(normal, step)
    for a in range(n):
        normal[n, n] += 2.0 * step[a] * normal[a, n]
    for a in range(n):
        value[a] = min(max(value[a] + step[a], lower[a]), upper[a])


@kernel()
def factor_carried(  # type: ignore[no-untyped-def]
    mass, viscous, period, noise, white, shared, stuck, share, haze, use, pull, keep, left, factor
):
    """Factor the covariance of the rows less what they keep of the ones before, L D L'.

    Args:
        mass: of the residual [kg].
        viscous: coefficient [N s/m].
        period: of the samples [s].
        noise: rms of a position [m].
        white: variance of the force [N^2].
        shared: what it grows by, of `share_rounding` [N^2], shape (K,).
        stuck: stiffness of what sticks at each row [N/m], shape (K,).
        share: where a row turns, else negative, shape (K,).
        haze: variance of what a turn leaves open [N^2], shape (K,).
        use: rows that count, shape (K,).
        pull: of `carry`.
        keep: the same; becomes 0 where the row before does not count.
        left: the same.
        factor: written: inverse of D, and the three diagonals below it, shape (REACH, K).
    """
    outer = noise * mass / period**2
    before, after = outer - 0.5 * noise * viscous / period, outer + 0.5 * noise * viscous / period
    inverse, first, second, third = factor[0], factor[1], factor[2], factor[3]
    by = np.zeros((REACH, REACH))  # of this row and the three before, by position
    here = own = 0.0
    for k in range(use.shape[0]):
        for j in range(REACH - 1, 0, -1):
            for i in range(REACH):
                by[j, i] = by[j - 1, i]
        for i in range(REACH):
            by[0, i] = factor[i, k] = 0.0
        here_last, own_last = here, own
        here = noise * stuck[k] - 2.0 * outer
        if not use[k] or k == 0 or not use[k - 1]:
            keep[k] = 0.0
        if not use[k]:
            continue
        own = white + shared[k] + (haze[k] if share[k] >= 0.0 else 0.0)
        by[0, 0] = pull[0, k] - keep[k] * before
        by[0, 1] = pull[1, k] + before - keep[k] * here_last
        by[0, 2] = pull[2, k] + here - keep[k] * after
        by[0, 3] = pull[3, k] + after
        # The first position's error is an unknown of its own.
        for i in range(2 - k):
            by[0, i] = 0.0
        variance = own + (keep[k] * keep[k] * own_last if keep[k] > 0.0 else left[k])
        for i in range(REACH):
            variance += by[0, i] * by[0, i]
        c1 = _common(by, 1) - keep[k] * own_last
        c2, c3 = _common(by, 2), _common(by, 3)
        if k > 2:
            third[k] = c3 * inverse[k - 3]
            c2 -= c3 * first[k - 2]
            c1 -= c3 * second[k - 1]
        if k > 1:
            second[k] = c2 * inverse[k - 2]
            c1 -= c2 * first[k - 1]
        if k > 0:
            first[k] = c1 * inverse[k - 1]
        inverse[k] = 1.0 / (variance - c1 * first[k] - c2 * second[k] - c3 * third[k])


@kernel()
def _common(by, rows):  # type: ignore[no-untyped-def]
    """Covariance of a row with the one so many rows before, by the positions of both."""
    total = 0.0
    for i in range(REACH - rows):
        total += by[0, i] * by[rows, i + rows]
    return total


@kernel()
def whiten_carried(row, keep, factor):  # type: ignore[no-untyped-def]
    """Take out of a column what its earlier rows explain, in place."""
    before = y1 = y2 = y3 = 0.0
    for k in range(row.shape[0]):
        this = row[k]
        y0 = this - keep[k] * before
        y0 = ((y0 - factor[3, k] * y3) - factor[2, k] * y2) - factor[1, k] * y1
        before, row[k] = this, y0
        y3, y2, y1 = y2, y1, y0
