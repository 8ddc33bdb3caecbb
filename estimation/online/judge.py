"""Whether an estimate can be trusted, and of which figures the move says anything."""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import kernel
from estimation.online.belief import ALPHA, COULOMB, LEVEL, MASS, RATE
from estimation.online.update_tables import (
    ACCEPTED,
    BOUND,
    C_COMPLETE,
    C_JUMP,
    C_JUMP_SHARE,
    C_LEAST,
    C_MISFIT,
    HOLES,
    JUMP,
    MISFIT,
    R_BOUND,
    R_CHI_A,
    R_CHI_B,
    R_FAILED,
    R_SLIDE,
    R_STEADY,
    R_STICK,
    R_WHY,
    SHAKEN,
    STILL,
    U_BEFORE,
    U_COVARIANCE,
    U_FIGURE,
    U_FOUND,
    U_GAIN,
    U_HELD,
    U_LEVEL,
    U_MEAN,
    U_MISFIT,
    U_NUMBER,
    U_SLIDING,
    U_SPREAD,
    U_VERDICT,
    UNSOLVED,
)

MOSTLY = 0.25
"""A motion is not learned from where its force was upset but for less than this share of it."""


@kernel()
def end_update(  # type: ignore[no-untyped-def]
    samples, constants, masks, before, spread, found, uncertain, whole, mean, covariance, p, result
):
    """Decide whether the estimate can be trusted, and of which figures the move says anything.

    Args:
        samples: of the move.
        constants: C_*.
        masks: figures that were solved for in zone A, in a move without zone A, and in one that has
            both, shape (3, LEVEL).
        before: belief before the move.
        spread: covariance of it.
        found: belief after it as the solve has it; becomes what is believed.
        uncertain: covariance of it; the same.
        whole: False for a look at a move that is not over: belief stays as it was.
        mean: belief after the last move; updated.
        covariance: of it; updated.
        p: written: what the friction state is to be carried to the end of the move with.
        result: U_*, written.

    Returns:
        Whether C/Fc or alpha may be others than the samples were last led through with.
    """
    usable, stick = result[U_NUMBER], result[R_STICK] > 0.0
    result[U_NUMBER] = 0.0
    result[U_MISFIT] = math.sqrt(result[R_CHI_B] if stick else result[R_CHI_A])
    if whole and usable < constants[C_COMPLETE] * samples:
        result[U_VERDICT], result[U_NUMBER] = HOLES, usable / samples
    elif whole and result[R_STEADY] < MOSTLY:
        result[U_VERDICT], result[U_NUMBER] = SHAKEN, result[R_STEADY]
    elif result[R_SLIDE] == 0.0 and not stick:
        result[U_VERDICT], result[U_NUMBER] = STILL, result[R_WHY]
    else:
        judge(before, spread, found, uncertain, constants, whole, result)
    sliding(before, spread, U_SLIDING, result)
    if result[R_FAILED] == 0.0:
        sliding(found, uncertain, U_SLIDING + 2, result)
    accepted = result[U_VERDICT] == ACCEPTED
    for i in range(LEVEL + 1):
        result[U_FOUND + i] = found[i]
        result[U_BEFORE + i] = math.sqrt(spread[i, i])
        result[U_GAIN + i] = math.sqrt(spread[i, i] / uncertain[i, i]) if accepted else 1.0
    if accepted and constants[C_LEAST] > 0.0:
        for row in range(LEVEL):
            gain = result[U_GAIN + row]
            if 1.0 + 1e-9 < gain and gain * gain < 1.0 + constants[C_LEAST]:
                hold(row, before, spread, found, uncertain, result)
                result[U_HELD + row] = 1.0
            elif gain <= 1.0 + 1e-9 and asked(row, masks, result):
                result[U_HELD + row] = 1.0
    for i in range(LEVEL + 1):
        if not accepted:
            found[i] = before[i]
        for j in range(LEVEL + 1):
            if not accepted:
                uncertain[i, j] = spread[i, j]
            result[U_COVARIANCE + i * (LEVEL + 1) + j] = uncertain[i, j]
            if whole:
                covariance[i, j] = uncertain[i, j]
        result[U_MEAN + i] = p[i] = found[i]
        result[U_SPREAD + i] = math.sqrt(uncertain[i, i])
        if whole:
            mean[i] = found[i]
    result[U_LEVEL] = 1.0 + found[LEVEL]
    for i in range(LEVEL, p.shape[0]):
        p[i] = 0.0
    p[COULOMB] *= result[U_LEVEL]
    moved = p[RATE] != before[RATE] or p[ALPHA] != before[ALPHA]
    return moved or asked(RATE, masks, result) or asked(ALPHA, masks, result)


@kernel()
def judge(before, spread, found, uncertain, constants, commit, result):  # type: ignore[no-untyped-def]
    """Whether what was found can be trusted."""
    sound = result[R_FAILED] == 0.0
    for i in range(LEVEL + 1):
        sound = sound and math.isfinite(found[i]) and uncertain[i, i] > 0.0
    if not sound:
        result[U_VERDICT] = UNSOLVED
    elif not result[U_MISFIT] <= constants[C_MISFIT]:
        result[U_VERDICT], result[U_NUMBER] = MISFIT, result[U_MISFIT]
    elif result[R_BOUND] >= 0.0:
        result[U_VERDICT], result[U_FIGURE] = BOUND, result[R_BOUND]
    elif commit:
        figure = jumping(before, spread, found, uncertain, constants)
        if figure >= 0:
            result[U_VERDICT], result[U_FIGURE] = JUMP, figure
            result[U_NUMBER] = found[figure] / before[figure] - 1.0


@kernel()
def jumping(before, spread, found, uncertain, constants):  # type: ignore[no-untyped-def]
    """The first figure that changes by more than drift can explain, or -1.

    A move changes a figure by as much as it narrows it (the variance of a Kalman filter's step is
    that before less that after): one that says little may not change much.
    """
    for i in range(MASS):
        narrowed = max(spread[i, i] - uncertain[i, i], 0.0)
        allowed = constants[C_JUMP] * math.sqrt(narrowed) / before[i]
        if abs(found[i] / before[i] - 1.0) > max(allowed, constants[C_JUMP_SHARE]):
            return i
    return -1


@kernel()
def sliding(mean, covariance, at, result):  # type: ignore[no-untyped-def]
    """Fc (1 + w), relative, and its variance, into two places of the result."""
    coulomb, level = mean[COULOMB], 1.0 + mean[LEVEL]
    result[at] = coulomb * level
    result[at + 1] = (
        level * level * covariance[COULOMB, COULOMB]
        + 2.0 * level * coulomb * covariance[COULOMB, LEVEL]
        + coulomb * coulomb * covariance[LEVEL, LEVEL]
    )


@kernel()
def asked(figure, masks, report):  # type: ignore[no-untyped-def]
    """Whether a figure was solved for in this move."""
    if report[R_SLIDE] == 0.0:
        return masks[1, figure]
    return masks[2, figure] if report[R_STICK] > 0.0 else masks[0, figure]


@kernel()
def hold(figure, before, spread, found, uncertain, result):  # type: ignore[no-untyped-def]
    """Leave a figure at its prior; the others are what they are if it is there.

    Their covariance takes in what the held figure leaves open.
    """
    variance, kept = uncertain[figure, figure], spread[figure, figure]
    away = before[figure] - found[figure]
    slope = np.empty(LEVEL + 1)
    for i in range(LEVEL + 1):
        held = i < LEVEL and result[U_HELD + i] > 0.0  # already: stays
        slope[i] = 0.0 if held else uncertain[figure, i] / variance
    for i in range(LEVEL + 1):
        found[i] += slope[i] * away
        for j in range(LEVEL + 1):
            uncertain[i, j] += slope[i] * slope[j] * (kept - variance)
