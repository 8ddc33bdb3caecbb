"""What a move counts for whose residual is larger than noise explains.

Its information counts by 1/misfit^2, as if its noise had been that much larger.
"""

from __future__ import annotations

import numpy as np

from estimation.compiled import kernel
from estimation.least_squares import cholesky_inverse


@kernel()
def temper(before, spread, found, uncertain, misfit):  # type: ignore[no-untyped-def]
    """Take back what a move says beyond what its residual lets one believe.

    A figure of which nothing is free keeps what was found.

    Args:
        before: belief before the move, shape (n,).
        spread: covariance of it, shape (n, n).
        found: belief after it; changed.
        uncertain: covariance of it; changed.
        misfit: rms of the whitened residual; nothing happens where it is 1 or less.
    """
    n = found.shape[0]
    chosen = np.empty(n, dtype=np.int64)
    m = n - n  # not written as 0: numba would compile anew what takes it, for a constant
    for i in range(n):
        if uncertain[i, i] < spread[i, i] * (1.0 - 1e-9):
            chosen[m] = i
            m += 1
    if not misfit > 1.0 or m == 0:
        return
    earlier, later = np.empty((m, m)), np.empty((m, m))
    for a in range(m):
        for b in range(m):
            earlier[a, b] = spread[chosen[a], chosen[b]]
            later[a, b] = uncertain[chosen[a], chosen[b]]
    if not cholesky_inverse(earlier) or not cholesky_inverse(later):
        return
    share, pull = 1.0 / (misfit * misfit), np.zeros(m)
    for a in range(m):
        for b in range(m):
            pull[a] += (1.0 - share) * earlier[a, b] * before[chosen[b]]
            pull[a] += share * later[a, b] * found[chosen[b]]
            later[a, b] = earlier[a, b] + share * (later[a, b] - earlier[a, b])
    if not cholesky_inverse(later):
        return
    for a in range(m):
        value = 0.0
        for b in range(m):
            value += later[a, b] * pull[b]
            uncertain[chosen[a], chosen[b]] = later[a, b]
        found[chosen[a]] = value
