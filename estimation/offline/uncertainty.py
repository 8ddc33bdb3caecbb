"""How well a fit determines each figure: sigma, and the verdict on it.

Sigma is the larger of two: what noise explains (inflated where the residual is above it), and how
much the blocks of the record disagree, which also covers model errors that are correlated over many
samples.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.offline.fit import Fit
from estimation.offline.unknowns import FIGURES, MASS, Unknowns
from stagedata import F64

ESTIMATED, PRIOR, BOUND = "estimated", "stays at its prior", "refused: on its bound"
TOGETHER = "with its neighbours"
"""Verdict on one k_i or nu_i of a shape that is only determined as a whole."""
LEAST_LEFT = 0.2
"""Of the blocks, at least this share counts as degrees of freedom, however many unknowns."""


def regress_on_mass(u: Unknowns, fit: Fit) -> F64:
    """Change of every value by that of the mass, under the covariance of the fit, shape (n,)."""
    slopes = u.slopes(fit.q)
    covariance: F64 = slopes @ fit.covariance @ slopes.T
    result: F64 = covariance[:, MASS] / covariance[MASS, MASS]
    return result


def find_sigma(u: Unknowns, fit: Fit, shared: bool = False) -> F64:
    """Standard deviations of the values, shape (n,): by noise, or by the blocks' disagreement.

    `shared`: corrected for the degrees of freedom of all that was fitted to the same blocks.
    """
    slopes = u.slopes(fit.q)
    covariance = slopes @ fit.covariance @ slopes.T
    noise = np.sqrt(np.maximum(covariance.diagonal(), 0.0)) * max(1.0, fit.misfit)
    scores = fit.scores[np.abs(fit.scores).max(axis=1) > 0]
    count = len(scores)
    if count < 3:
        return noise
    each = (scores - scores.mean(axis=0)) @ fit.covariance @ slopes.T
    left = count - 1.0
    if shared:
        narrowed = 1.0 - (fit.covariance.diagonal() / u.spread**2)[fit.covariance.diagonal() > 0.0]
        left = max(left - float(narrowed.clip(0.0, 1.0).sum()), LEAST_LEFT * count)
    spread: F64 = np.sqrt((each**2).sum(axis=0) * count / left)
    return np.maximum(noise, spread)


def find_prior_sigma(u: Unknowns) -> F64:
    """Standard deviations of the values before; those of k_i and nu_i for a sum of one."""
    slopes = u.slopes(u.mean)
    result: F64 = np.sqrt(slopes**2 @ u.spread**2)
    return result


def judge(u: Unknowns, q: F64, sigma: F64, spread: F64, free: NDArray[np.bool_]) -> list[str]:
    """Verdict on every unknown; the shape of the hysteresis is determined as a whole or not.

    Args:
        u: the unknowns.
        q: estimates in scales, shape (n,).
        sigma: standard deviations of the values, shape (n,).
        spread: the same before, shape (n,).
        free: what was solved for, shape (n,).
    """
    bound = free & ((q <= u.lower) | (q >= u.upper)) & (u.lower < u.mean)
    weak = (sigma > spread / math.sqrt(2.0)) | ~free
    verdicts = [BOUND if b else PRIOR if w else ESTIMATED for b, w in zip(bound, weak, strict=True)]
    first = len(FIGURES)
    undetermined = bool(bound[first:].any()) or bool(weak[first:].mean() > 0.5)
    for i in range(first, len(verdicts)):
        if verdicts[i] != BOUND and (undetermined or weak[i]):
            verdicts[i] = PRIOR if undetermined else TOGETHER
    return verdicts
