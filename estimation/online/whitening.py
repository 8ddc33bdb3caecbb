"""Weights of the residual's rows, and the normal equations under them.

Row k is off by what the encoder adds to its three positions and by what the force adds:

    (m/T^2 - c/2T) e[k-1] + (kappa_k - 2m/T^2) e[k] + (m/T^2 + c/2T) e[k+1] + white_k

with kappa_k the stiffness of the elements that stick there and c the viscous coefficient. The
covariance has a band of five and is factored row by row, L D L'. At low frequencies, where the
second difference hides the encoder, kappa is what is left of it: without it the presliding
stiffness is weighed wrongly.
"""

from __future__ import annotations

from estimation.compiled import kernel


@kernel(fastmath={"contract"})
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
        # As little as can be waits for the row before.
        pull = before * here_last + here * after - c2 * off
        first, second = pull * weight, c2 * weight_last
        variance = (outer - edge + here * here + white[k] - second * c2) - first * pull
        weight_last, weight = weight, 1.0 / variance
        off, here_last = first, here
        lower[k], lowest[k], inverse[k] = first, second, weight


@kernel(fastmath={"contract"})
def whiten(columns, chosen, lower, lowest):  # type: ignore[no-untyped-def]
    """Take out of every chosen column what earlier rows explain, in place."""
    n = chosen.shape[0]
    # Three or four at a time, because each step waits for the one before; some may come twice.
    passes = (n + 3) // 4
    each = (n + passes - 1) // passes
    for i in range(0, n, each):
        a, b = columns[chosen[i]], columns[chosen[min(i + 1, n - 1)]]
        c, d = columns[chosen[min(i + 2, n - 1)]], columns[chosen[min(i + 3, n - 1)]]
        if each == 4:
            _whiten_four(a, b, c, d, lower, lowest)
        else:
            _whiten_three(a, b, c, lower, lowest)


@kernel(fastmath={"contract"})
def _whiten_three(a, b, c, lower, lowest):  # type: ignore[no-untyped-def]
    a1 = a2 = b1 = b2 = c1 = c2 = 0.0
    for k in range(a.shape[0]):
        first, second = lower[k], lowest[k]
        a0 = (a[k] - second * a2) - first * a1
        b0 = (b[k] - second * b2) - first * b1
        c0 = (c[k] - second * c2) - first * c1
        a[k], b[k], c[k] = a0, b0, c0
        a2, a1, b2, b1, c2, c1 = a1, a0, b1, b0, c1, c0


@kernel(fastmath={"contract"})
def _whiten_four(a, b, c, d, lower, lowest):  # type: ignore[no-untyped-def]
    a1 = a2 = b1 = b2 = c1 = c2 = d1 = d2 = 0.0
    for k in range(a.shape[0]):
        first, second = lower[k], lowest[k]
        a0 = (a[k] - second * a2) - first * a1
        b0 = (b[k] - second * b2) - first * b1
        c0 = (c[k] - second * c2) - first * c1
        d0 = (d[k] - second * d2) - first * d1
        a[k], b[k], c[k], d[k] = a0, b0, c0, d0
        a2, a1, b2, b1, c2, c1, d2, d1 = a1, a0, b1, b0, c1, c0, d1, d0


@kernel(fastmath={"reassoc", "contract"})
def _dots(weight, a, b, c0, c1, c2, c3):  # type: ignore[no-untyped-def]
    """Weighted products of two rows with four: what is loaded once serves several sums."""
    a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = 0.0
    for k in range(weight.shape[0]):
        x, y = a[k] * weight[k], b[k] * weight[k]
        a0 += x * c0[k]
        b0 += y * c0[k]
        a1 += x * c1[k]
        b1 += y * c1[k]
        a2 += x * c2[k]
        b2 += y * c2[k]
        a3 += x * c3[k]
        b3 += y * c3[k]
    return a0, a1, a2, a3, b0, b1, b2, b3


@kernel()
def normal_equations(columns, chosen, inverse, normal):  # type: ignore[no-untyped-def]
    """Weighted products of all chosen whitened columns, shape (n, n), both triangles."""
    n = chosen.shape[0]
    # Two rows by four columns at a time; the last ones may come twice.
    for i in range(0, n, 2):
        i1 = min(i + 1, n - 1)
        a, b = columns[chosen[i]], columns[chosen[i1]]
        for j in range(0, i1 + 1, 4):
            j1, j2, j3 = min(j + 1, n - 1), min(j + 2, n - 1), min(j + 3, n - 1)
            a0, a1, a2, a3, b0, b1, b2, b3 = _dots(
                inverse, a, b, columns[chosen[j]], columns[chosen[j1]], columns[chosen[j2]],
                columns[chosen[j3]],
            )  # fmt: skip
            normal[i, j], normal[i, j1], normal[i, j2], normal[i, j3] = a0, a1, a2, a3
            normal[i1, j], normal[i1, j1], normal[i1, j2], normal[i1, j3] = b0, b1, b2, b3
    for i in range(n):
        for j in range(i):
            normal[j, i] = normal[i, j]
