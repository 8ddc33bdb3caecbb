"""Whether an estimate can be trusted, and which figures the move determines.

Of each figure, with mean m and variance P before (-) and after (+) the move:

    n = P- - P+                      variance of the change, as of a Kalman filter's step
    jump:        |ln(m+/m-)| > max(JUMP_SIGMAS sqrt(s n)/m-, JUMP_SHARE)
    innovation:  z = (m+ - m-)^2 / n, expected 1;  share of information  h = n/P-
    s <- s + h (z - s)/(weight + h)  factor on the figure's variance (Birge's ratio), 1 or more
    gain:        P-/P+ - 1, information of the move over that of the prior; held if it is small

The move alone, without the prior, shows m- + (m+ - m-) P-/n with the variance P+ P-/n.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.online.belief.belief import COULOMB, LAG, LEVEL, MASS, STATES
from estimation.online.outcome import (
    ACCEPTED,
    BOUND,
    DISTURBED,
    HOLES,
    JUMP,
    MISFIT,
    MISSED,
    SCALE,
    STILL,
    UNSOLVED,
)
from stagedata.compiled import kernel

COMPLETE = 0.8
"""A move of which less than this share of the samples is valid is followed, but not learned
from."""
JUMP_SIGMAS, JUMP_SHARE = 6.0, 0.15
"""A change of a figure by more than so many predicted standard deviations, and by more than this
share of it, is refused."""
LEAST_GAIN = 0.05
"""A figure to which a move adds less than this share of its prior's information stays at its
prior."""
MOSTLY = 0.25
"""A move is rejected if its force was undisturbed in less than this share of the motion."""
KNOWN_SCALE, SCALE_SHARE = 0.02, 0.05
"""The force per acceleration counts as known below this relative sigma, and as changed when it
changes by more than this share."""
SHOWS_SCALE = 0.02
"""Largest relative sigma of the apparent mass, as a move alone shows it, at which the move tells
whether the force's scale is right."""
MOST_MISSED = 0.2
"""Largest rms model error of this and earlier moves, relative to the Coulomb force. Above it some
other effect acts, and an onset or a curve that is found is due to that effect."""
LEARNED = 0.3
"""A figure with a larger relative sigma is still a guess, and its past changes do not count."""
UNUSUAL = 1.6
"""A move whose misfit exceeds the usual one by more than this factor gets less weight: its model
error is not typical of other moves."""


class Verdict(NamedTuple):
    """Verdict on a move; the fields are those of `Outcome`."""

    code: int
    figure: int
    number: float


@kernel()
def judge(prepared, solution, missed, axis, whole, before, after):  # type: ignore[no-untyped-def]
    """Whether what was found can be trusted.

    Args:
        prepared: the move.
        solution: of the last solve.
        missed: rms model error in the move, relative to the Coulomb force.
        axis: settings.
        whole: False for a preview while the move is still under way.
        before: belief before the move.
        after: belief after it.
    """
    size, misfit = prepared.samples.position.shape[0], math.sqrt(solution.chi)
    if whole and prepared.counted < COMPLETE * size:
        return Verdict(HOLES, -1, prepared.counted / size)
    if whole and prepared.steady < MOSTLY:
        return Verdict(DISTURBED, -1, prepared.steady)
    if prepared.slide == 0 and prepared.stick == 0:
        return Verdict(STILL, -1, float(prepared.why))
    sound = solution.status == 0
    for i in range(STATES):
        sound = sound and math.isfinite(after.mean[i]) and after.covariance[i, i] > 0.0
    if not sound:
        return Verdict(UNSOLVED, -1, 0.0)
    if not misfit <= axis.misfit:
        return Verdict(MISFIT, -1, misfit)
    if whole and max(axis.model_error, missed) > max(MOST_MISSED, axis.usual_error):
        return Verdict(MISSED, -1, max(axis.model_error, missed))
    if whole and solution.bound != LAG and is_another_scale(prepared.slide, axis, before, after):
        kept = after.covariance[MASS, MASS] / before.covariance[MASS, MASS]
        change = after.mean[MASS] / before.mean[MASS] - 1.0
        return Verdict(SCALE, MASS, change / max(1.0 - kept, 1e-3))  # as the move alone shows it
    if solution.bound >= 0:
        return Verdict(BOUND, solution.bound, 0.0)
    figure = find_jump(axis, before, after) if whole else -1
    if figure >= 0:
        return Verdict(JUMP, figure, after.mean[figure] / before.mean[figure] - 1.0)
    return Verdict(ACCEPTED, -1, 0.0)


@kernel()
def find_jump(axis, before, after):  # type: ignore[no-untyped-def]
    """The first figure that jumps, i.e. changes by more than its variances allow; -1 if none does.

    A move that narrows a figure little may not change it much. Figures are scales, and eight times
    the expected value is as likely as an eighth of it, so changes are those of the logarithm. Once
    a figure is known to `LEARNED`, the size of its earlier changes (s) widens what is allowed.
    Arguments as of `judge`.
    """
    for i in range(MASS):
        narrowed = max(before.covariance[i, i] - after.covariance[i, i], 0.0)
        if before.covariance[i, i] < (LEARNED * before.mean[i]) ** 2:
            narrowed *= max(axis.scale[i], 1.0)
        allowed = JUMP_SIGMAS * math.sqrt(narrowed) / before.mean[i]
        # One that is no longer positive has changed beyond any bound.
        change = math.log(max(after.mean[i] / before.mean[i], 1e-9))
        if abs(change) > max(allowed, JUMP_SHARE):
            return i
    return -1


@kernel()
def is_another_scale(slide, axis, before, after):  # type: ignore[no-untyped-def]
    """Whether the force per acceleration has changed since it became known.

    Friction cannot change it; the force constant, the force measurement or the mass can. All
    figures are then off by the same factor. A move without zone A (`slide`: number of its samples)
    is not judged: there, other model errors shift the mass. Other arguments as for `judge`.
    """
    variance, mean = before.covariance[MASS, MASS], before.mean[MASS]
    narrowed = max(variance - after.covariance[MASS, MASS], 0.0)
    if slide == 0 or not 0.0 < variance < (KNOWN_SCALE * mean) ** 2:
        return False
    if after.covariance[MASS, MASS] * variance > narrowed * (SHOWS_SCALE * mean) ** 2:
        return False
    change = abs(after.mean[MASS] - mean)
    return (
        change > JUMP_SIGMAS * math.sqrt(narrowed)
        and change > SCALE_SHARE * mean * narrowed / variance  # as the move alone shows it
    )


@kernel()
def noise_excess(prepared, solution, axis):  # type: ignore[no-untyped-def]
    """Factor (at least 1) by which the noise of the move exceeds the assumed noise."""
    misfit = math.sqrt(max(solution.chi, solution.slow))
    # Samples kept between late setpoints are disturbed by them, too.
    excess = max(misfit, 1.0 / max(prepared.steady, MOSTLY) ** 2)
    if misfit > UNUSUAL * axis.usual_misfit:
        excess = max(excess, misfit / axis.usual_misfit)
    return max(excess, 1.0)


@kernel()
def normalised_innovations(verdict, axis, before, after):  # type: ignore[no-untyped-def]
    """Normalised innovations of the friction figures in one move, shape (2, MASS).

    Row 0: squares of their changes over the variances by which the move narrows them (that of a
    Kalman filter's step), 1 where sigma is right; row 1: these over the variances before, the share
    of what is known that comes from this move. The Coulomb force is taken at its level. Zeros where
    nothing was found; the arguments as of `judge`.
    """
    found = np.zeros((2, MASS))
    if verdict.code != ACCEPTED and verdict.code != JUMP:
        return found
    for i in range(MASS):
        change, variance = after.mean[i] - before.mean[i], before.covariance[i, i]
        left = after.covariance[i, i]
        if i == COULOMB:
            earlier, variance = sliding_level(before)
            later, left = sliding_level(after)
            change = later - earlier
        narrowed = variance - left
        if narrowed > 1e-9 * variance:
            found[0, i] = min(change * change / narrowed, JUMP_SIGMAS**2)
            found[1, i] = narrowed / variance
    return found


@kernel()
def scale_covariance(covariance, innovations, scale, weights, most):  # type: ignore[no-untyped-def]
    """Multiply variances by the mean square of the normalised innovations, 1 or more.

    Args:
        covariance: of all states, shape (STATES, STATES); changed.
        innovations: of the move, see `normalised_innovations`.
        scale: running mean square so far, shape (LEVEL,); the first MASS entries are updated.
        weights: of that mean, in fully informative moves, shape (MASS,); updated.
        most: upper limit of `weights`.
    """
    for i in range(MASS):
        share = innovations[1, i]
        scale[i] += share * (innovations[0, i] - scale[i]) / (weights[i] + share)
        weights[i] = min(weights[i] + share, most)
        factor = math.sqrt(max(scale[i], 1.0))
        for j in range(STATES):
            covariance[i, j] *= factor
            covariance[j, i] *= factor


@kernel()
def hold_undetermined(axis, mask, before, after):  # type: ignore[no-untyped-def]
    """Reset figures that the move hardly determines to their prior; returns which, shape (LEVEL,).

    `mask`: figures that were solved for, shape (LEVEL,); `after` is changed. The other figures
    are re-estimated given the held ones. Figures that are only considered return to their prior
    mean and variance but keep their covariances with the others, whose estimates stand
    (Schmidt-Kalman filter).
    """
    held, gains = np.zeros(LEVEL, np.bool_), np.empty(LEVEL)
    for i in range(LEVEL):
        gains[i] = before.covariance[i, i] / after.covariance[i, i]
    for i in range(LEVEL):
        if gains[i] > (1.0 + 1e-9) ** 2:
            if axis.consider[i]:
                after.mean[i], after.covariance[i, i] = before.mean[i], before.covariance[i, i]
                held[i] = True
            elif gains[i] < 1.0 + LEAST_GAIN:
                _hold(i, held, before, after)
                held[i] = True
        elif mask[i]:
            held[i] = True
    return held


@kernel()
def _hold(figure, held, before, after):  # type: ignore[no-untyped-def]
    """Reset figure i to its prior; correct the others j and the covariance by regression on it.

    m_j += P_ij/P_ii (m-_i - m_i),  P_jk += P_ij P_ik/P_ii^2 (P-_ii - P_ii)
    """
    found, uncertain = after.mean, after.covariance
    variance, kept = uncertain[figure, figure], before.covariance[figure, figure]
    away = before.mean[figure] - found[figure]
    slope = np.zeros(STATES)
    for i in range(STATES):
        if i >= LEVEL or not held[i]:
            slope[i] = uncertain[figure, i] / variance
    for i in range(STATES):
        found[i] += slope[i] * away
        for j in range(STATES):
            uncertain[i, j] += slope[i] * slope[j] * (kept - variance)


@kernel()
def sliding_level(belief):  # type: ignore[no-untyped-def]
    """Fc (1 + w), relative, and its variance."""
    covariance, level = belief.covariance, 1.0 + belief.mean[LEVEL]
    coulomb = belief.mean[COULOMB]
    variance = (
        level * level * covariance[COULOMB, COULOMB]
        + 2.0 * level * coulomb * covariance[COULOMB, LEVEL]
        + coulomb * coulomb * covariance[LEVEL, LEVEL]
    )
    return coulomb * level, variance
