"""Figures that differ from move to move, and what one move's figures say about those of the axis.

Where a stage is not as modelled, viscous friction, presliding stiffness and relaxation rate vary
with direction, speed and place. A move is therefore solved for figures of its own: those of the
axis plus a deviation. The rms of the deviations is a guess at first and is learned from the moves
(empirical Bayes). The Coulomb force has its level for this.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.least_squares import cholesky_inverse
from estimation.online.belief.arrival_cost import copy
from estimation.online.belief.belief import MASS
from stagedata.compiled import kernel


@kernel()
def scattered(belief, axis):  # type: ignore[no-untyped-def]
    """The prior of one move's own figures: the belief of the axis, widened by their scatter."""
    met = copy(belief)
    for i in range(MASS):
        met.covariance[i, i] += (axis.scatter[i] * belief.mean[i]) ** 2
    return met


@kernel()
def temper(before, met, after, excess):  # type: ignore[no-untyped-def]
    """Turn the solution for a move's own figures into the belief of those of the axis.

    The move counts less if its noise was larger than assumed or its figures may deviate.

    Returns, for the deviations of its figures from those of the axis, the squares over their
    variances, and the shares of these variances that the move determines, shape (2, MASS).

    Args:
        before: belief before the move.
        met: the same of the move's own figures, the prior of the solve.
        after: of the move's own figures, as solved; becomes the belief after it. A figure that the
            move does not narrow keeps what was found.
        excess: factor on the noise, 1 or more.
    """
    chosen, deviation = _choose(before, met, after)
    m, shown = chosen.shape[0], np.zeros((2, MASS))
    if m == 0 or not (excess > 1.0 or deviation.any()):
        return shown
    earlier, later = _part(met.covariance, chosen), _part(after.covariance, chosen)
    prior = _part(before.covariance, chosen)
    if not (cholesky_inverse(earlier) and cholesky_inverse(later) and cholesky_inverse(prior)):
        return shown
    share, away, gained = 1.0 / (excess * excess), np.empty(m), np.empty((m, m))
    for a in range(m):
        away[a] = after.mean[chosen[a]] - before.mean[chosen[a]]
        for b in range(m):
            gained[a, b] = share * (later[a, b] - earlier[a, b])
    pull = share * _times(later, away)
    if not _loosen(deviation, gained, pull):
        return shown
    for a in range(m):
        for b in range(m):
            prior[a, b] += gained[a, b]
    if not cholesky_inverse(prior):
        return shown
    step = _times(prior, pull)
    for a in range(m):
        after.mean[chosen[a]] = before.mean[chosen[a]] + step[a]
        for b in range(m):
            after.covariance[chosen[a], chosen[b]] = prior[a, b]
    left = _times(gained, step)
    for a in range(m):
        if deviation[a] > 0.0:
            # The innovation over its covariance, and the inverse of that covariance.
            residual, known = pull[a] - left[a], gained[a, a]
            along = _times(prior, gained[a])
            for b in range(m):
                known -= gained[a, b] * along[b]
            shown[0, chosen[a]] = (deviation[a] * residual) ** 2
            shown[1, chosen[a]] = min(max(deviation[a] ** 2 * known, 0.0), 1.0)
    return shown


@kernel()
def _choose(before, met, after):  # type: ignore[no-untyped-def]
    """States that a move narrows, and standard deviations of its own ones from them, shapes (m,).

    Arguments as of `temper`; the others' variances in `after` become those of the axis.
    """
    n, m = after.mean.shape[0], 0
    chosen, deviation = np.empty(n, dtype=np.int64), np.zeros(n)
    for i in range(n):
        variance = met.covariance[i, i] - before.covariance[i, i]
        if after.covariance[i, i] < met.covariance[i, i] * (1.0 - 1e-9):
            chosen[m], deviation[m] = i, math.sqrt(variance)
            m += 1
        else:
            after.covariance[i, i] -= variance
    return chosen[:m], deviation[:m]


@kernel()
def _part(matrix, chosen):  # type: ignore[no-untyped-def]
    """Rows and columns `chosen`, shape (m,), of a matrix."""
    m = chosen.shape[0]
    part = np.empty((m, m))
    for a in range(m):
        for b in range(m):
            part[a, b] = matrix[chosen[a], chosen[b]]
    return part


@kernel()
def _times(matrix, x):  # type: ignore[no-untyped-def]
    """M x, shape (m,), for M of shape (m, m) and x of shape (m,)."""
    m = x.shape[0]
    result = np.zeros(m)
    for a in range(m):
        for b in range(m):
            result[a] += matrix[a, b] * x[b]
    return result


@kernel()
def _loosen(deviation, information, pull):  # type: ignore[no-untyped-def]
    """Turn information on a move's own figures into that on the axis' figures; False on failure.

    With I the information and D the deviations: I - I D (1 + D I D)^-1 D I.

    Args:
        deviation: standard deviations, shape (m,); 0: it is the same figure.
        information: shape (m, m); changed.
        pull: information times what was found, shape (m,); changed.
    """
    m, which = deviation.shape[0], np.flatnonzero(deviation)
    q = which.shape[0]
    inner, spread = np.eye(q), np.empty((m, q))
    for c in range(q):
        for a in range(m):
            spread[a, c] = information[a, which[c]] * deviation[which[c]]
        for d in range(q):
            inner[d, c] += deviation[which[d]] * spread[which[d], c]
    if not cholesky_inverse(inner):
        return False
    weighed = np.zeros(q)
    for c in range(q):
        for d in range(q):
            weighed[c] += inner[c, d] * deviation[which[d]] * pull[which[d]]
    for a in range(m):
        for c in range(q):
            pull[a] -= spread[a, c] * weighed[c]
            for d in range(q):
                for b in range(m):
                    information[a, b] -= spread[a, c] * inner[c, d] * spread[b, d]
    return True


@kernel()
def learn_scatter(shown, scatter, weights, least, most):  # type: ignore[no-untyped-def]
    """Learn how far moves' figures are from those of the axis (MacKay's update).

    Args:
        shown: by a move, see `temper`.
        scatter: rms, relative, shape (LEVEL,); 0: there is none; updated.
        weights: of it, in moves that determine it, shape (MASS,); updated.
        least: of `scatter`, shape (LEVEL,).
        most: of `weights`.
    """
    for i in range(MASS):
        if scatter[i] > 0.0:
            square = (weights[i] + shown[0, i]) / (weights[i] + shown[1, i])
            scatter[i] = max(scatter[i] * math.sqrt(square), least[i])
            weights[i] = min(weights[i] + shown[1, i], most)
