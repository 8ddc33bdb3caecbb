"""From the samples of a move to a verdict, compiled.

`begin_update` cleans the samples, ages the belief, takes the force at rest as the sum of the
element forces, finds the zones. `learn` solves them (`window.fit`, once or twice), decides whether
the estimate can be trusted and which figures the move says anything about, and carries the friction
state on. Two calls, not one: a compiled function carries all that it calls inside itself, and
everything in it is compiled anew with it. What they work on comes in few arrays, cut up inside:
each argument of a compiled call costs time.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from estimation.belief import ALPHA, COULOMB, LEVEL, MASS, RATE, STIFFNESS
from estimation.elements import (
    BY_COULOMB,
    BY_STIFFNESS,
    ELEMENT_ROWS,
    FORCE,
    SHARES,
    SLIPS,
    correct_forces,
)
from estimation.move_tables import (
    KNOTS,
    M_GOOD,
    M_HEADING,
    M_READY,
    M_UPSET,
    MARKS,
    MOST_KNOTS,
    SPARE,
    T_FORCE,
    T_POSITION,
    TABLES,
)
from estimation.rows import lead
from estimation.tempering import temper
from estimation.window import (
    C_CORRELATION,
    C_FORCE_NOISE,
    C_MODEL_ERROR,
    C_PERIOD,
    C_POSITION_NOISE,
    C_STEP,
    C_VS,
    C_WANDER,
    CONSTANTS,
    F_UNIT,
    QUIET,
    R_BOUND,
    R_CHI_A,
    R_CHI_B,
    R_END,
    R_FAILED,
    R_FAR,
    R_KNOWN,
    R_REST_FORCE,
    R_SLIDE,
    R_STEADY,
    R_STEP,
    R_STICK,
    R_TOLD,
    REPORT_SIZE,
    fit,
    knots_of,
    prepare,
)

# Constants behind those of `window`.
C_COMPLETE, C_MISFIT, C_JUMP, C_JUMP_SHARE, C_LEAST, C_TYPICAL = range(CONSTANTS, CONSTANTS + 6)
"""Last: what misfit this axis' moves usually have."""
ALL_CONSTANTS = CONSTANTS + 6
UNUSUAL = 1.6
"""A move whose misfit is more than so many times the usual one counts less: what the model misses
in it is not what it misses elsewhere."""
MOSTLY = 0.25
"""A motion is not learned from where its force was upset but for less than this share of it."""
F_DRIFT = 3
"""Row of an axis' table of figures: standard deviation by which each drifts from move to move."""

# Verdicts.
ACCEPTED, HOLES, STILL, UNSOLVED, MISFIT, BOUND, JUMP = range(7)

# What an update leaves, behind the report of `window`: verdict, the figure that it is about, a
# number that goes with it, misfit and level; then by figure: mean, spread, spread before, gain,
# whether it stays at its prior, and the mean that was found; then the sliding level and its
# variance, before and as found; the covariance.
U_VERDICT, U_FIGURE, U_NUMBER, U_MISFIT, U_LEVEL = range(REPORT_SIZE, REPORT_SIZE + 5)
U_MEAN = REPORT_SIZE + 5
U_SPREAD, U_BEFORE, U_GAIN, U_HELD, U_FOUND = (U_MEAN + i * (LEVEL + 1) for i in range(1, 6))
U_SLIDING = U_FOUND + LEVEL + 1
U_COVARIANCE = U_SLIDING + 4
UPDATE_SIZE = U_COVARIANCE + (LEVEL + 1) ** 2

# Beliefs of one move, end to end: mean before it and after it, their covariances, the unknowns,
# the figures that the elements were last led through with, and the solution.
B_BEFORE, B_FOUND, B_SPREAD = 0, LEVEL + 1, 2 * (LEVEL + 1)
B_UNCERTAIN = B_SPREAD + (LEVEL + 1) ** 2
B_UNKNOWNS = B_UNCERTAIN + (LEVEL + 1) ** 2
B_LED = B_UNKNOWNS + KNOTS + MOST_KNOTS
B_SOLVED = B_LED + LEVEL
BELIEFS = B_SOLVED + LEVEL
NEARLY, CLOSE = 0.01, 0.02
"""Figures that are what the solve found, to so many standard deviations, and have moved by no more
than that share since the elements were led through the move: the derivatives tell where it ends."""

# Which figures are solved for: usually, in moves that do not go far, in those that settle at once.
USUAL, SHORT, CALM = range(3)


@numba.njit(cache=True, error_model="numpy")
def begin_update(  # type: ignore[no-untyped-def]
    position, force, valid, upset, rest, rest_force, elapsed, restless, state_known, whole,
    constants, units, shares, mean, covariance, forces, memory, beliefs, floats, small, result,
):  # fmt: skip
    """Clean the samples, age the belief, correct the state by the force at rest, find the zones.

    Args:
        position: sampled [m], shape (K,).
        force: measured [N], shape (K,).
        valid: samples that can be used, shape (K,).
        upset: those of which only the position counts, shape (K,); none: shape (0,).
        rest: position there [m], where the first sample may be lost; nan: not known.
        rest_force: measured at rest before the move [N].
        elapsed: since the end of the last move [s]; negative: there was none.
        restless: variance by which Coulomb force ages beside its drift, relative.
        state_known: False where only the sum of the element forces is known.
        whole: False for a look at a move that is not over: zone A only.
        constants: C_*, shape (ALL_CONSTANTS,).
        units: of the figures, rows F_*, shape (4, LEVEL).
        shares: nu_i, shape (N,).
        mean: belief after the last move, shape (LEVEL + 1,).
        covariance: of it.
        forces: element forces at rest before the move [N], shape (N,); corrected.
        memory: of the friction state; becomes that at the end of the move.
        beliefs: B_*, written: belief before this move, and where belief after it begins; first
            iterate of the solves.
        floats: room of both calls, shape (>= `floats_for(K, N)`,); T_* of the data written.
        small: the same, shape (>= `marks_for(K)`,); M_* written.
        result: R_*, written; U_NUMBER becomes the number of valid samples.

    Returns:
        That number; nothing else is done where there are fewer than three.
    """
    for i in range(UPDATE_SIZE):
        result[i] = 0.0
    samples = position.shape[0]
    begin = SPARE + ELEMENT_ROWS * (shares.shape[0] + 1)
    tables = floats[begin : begin + TABLES * samples].reshape((TABLES, samples))
    marks = small[: MARKS * samples].reshape((MARKS, samples))
    known = units[F_UNIT, COULOMB] * mean[COULOMB]
    counted = clean(
        position, force, valid, rest, tables[T_POSITION], tables[T_FORCE], marks[M_GOOD]
    )
    result[U_NUMBER] = counted
    if counted < 3:
        return counted
    marks[M_UPSET] = 0
    for k in range(upset.shape[0]):
        marks[M_UPSET, k] = upset[k]
    before, spread = beliefs[B_BEFORE:B_FOUND], _square(beliefs[B_SPREAD:B_UNCERTAIN])
    found, uncertain = beliefs[B_FOUND:B_SPREAD], _square(beliefs[B_UNCERTAIN:B_UNKNOWNS])
    age(mean, covariance, elapsed, restless, constants, units, before, spread)
    correct_forces(
        forces, shares, known * (1.0 + before[LEVEL]) * (1.0 + before[ALPHA]), rest_force
    )
    step = constants[C_STEP]
    if step < 0.0:
        # Where the model misses more than that, rounding is not what matters.
        missed = constants[C_MODEL_ERROR] * known > 2.0 * constants[C_FORCE_NOISE]
        # The same where the encoder's noise is far more, as a force (see `window.QUIET`), and would
        # be with a fifth less mass: sqrt(12) and that.
        jitter = units[F_UNIT, MASS] * before[MASS] * constants[C_POSITION_NOISE]
        drowned = jitter > 4.5 * QUIET * constants[C_FORCE_NOISE] * constants[C_PERIOD] ** 2
        step = (
            0.0 if missed or drowned else rounding_step(tables[T_FORCE], constants[C_FORCE_NOISE])
        )
    result[R_STEP], result[R_KNOWN], result[R_REST_FORCE] = step, known, rest_force
    prepare(constants, units, shares, before, state_known, whole, tables, marks, result)
    for k in range(samples - 2):
        marks[M_READY, k] = 0
        if marks[M_HEADING, k] != 0:
            memory[0] = marks[M_HEADING, k]
    memory[1] = tables[T_POSITION, samples - 2]
    for i in range(KNOTS + MOST_KNOTS):
        beliefs[B_UNKNOWNS + i] = before[i] if i < LEVEL else 0.0
    for i in range(LEVEL + 1):
        found[i] = before[i]
        for j in range(LEVEL + 1):
            uncertain[i, j] = spread[i, j]
    return counted


@numba.njit(cache=True, error_model="numpy")
def _square(entries):  # type: ignore[no-untyped-def]
    """A matrix of figures and level out of its row of entries."""
    return entries.reshape((LEVEL + 1, LEVEL + 1))


@numba.njit(cache=True, error_model="numpy")
def learn(  # type: ignore[no-untyped-def]
    samples, whole, constants, units, shares, masks, mean, covariance, forces, slips, beliefs,
    floats, small, result,
):  # fmt: skip
    """Solve the zones, decide what is believed, and carry the friction state to the move's end.

    Args:
        samples: of the move, as above.
        whole: as above.
        constants: as above.
        units: as above.
        shares: as above.
        masks: figures to solve for in zone A, in a move without zone A, and in one that has both:
            usually, in moves that do not go far, in those that settle at once, shape (3, 3, LEVEL).
        mean: belief after the last move; updated, unless the move is not over.
        covariance: of it; the same.
        forces: as above; left as at the last sample.
        slips: which elements slip there, written, shape (N,).
        beliefs: as `begin_update` left it.
        floats: the same.
        small: the same.
        result: U_*, written.
    """
    n, count = shares.shape[0], samples - 2
    begin = SPARE + ELEMENT_ROWS * (n + 1)
    end = begin + TABLES * samples
    elements = floats[SPARE:begin].reshape((ELEMENT_ROWS, n + 1))
    tables = floats[begin:end].reshape((TABLES, samples))
    marks = small[: MARKS * samples].reshape((MARKS, samples))
    spare, scratch = floats[:SPARE], floats[end:]
    chosen = small[MARKS * samples :]
    for i in range(n):
        elements[SHARES, i] = shares[i]
    before, spread = beliefs[B_BEFORE:B_FOUND], _square(beliefs[B_SPREAD:B_UNCERTAIN])
    found, uncertain = beliefs[B_FOUND:B_SPREAD], _square(beliefs[B_UNCERTAIN:B_UNKNOWNS])
    knots = knots_of(count, constants[C_PERIOD], constants[C_WANDER])
    p = beliefs[B_UNKNOWNS : B_UNKNOWNS + KNOTS + knots]
    slide, stick = result[R_SLIDE] > 0.0, result[R_STICK] > 0.0
    led, solved = beliefs[B_LED:B_SOLVED], beliefs[B_SOLVED:BELIEFS]
    kind = CALM if result[R_TOLD] == 0.0 else USUAL if result[R_FAR] > 0.0 else SHORT
    for both in (False, True):
        if (stick if both else slide) and result[R_BOUND] < 0.0 and result[R_FAILED] == 0.0:
            fit(
                both, tables, marks, constants, units, forces, before, spread, found, uncertain,
                masks[kind, 0 if not both else 2 if slide else 1], p, led, elements, chosen,
                spare, scratch, result,
            )  # fmt: skip
    misfit = math.sqrt(result[R_CHI_B] if stick else result[R_CHI_A])
    # What is left between jolts of the drive is not free of them either.
    doubt = max(misfit, 1.0 / max(result[R_STEADY], MOSTLY) ** 2)
    if misfit > UNUSUAL * constants[C_TYPICAL]:
        doubt = max(doubt, misfit / constants[C_TYPICAL])
    # A figure that jumps is for `end_update` to see.
    if (
        misfit <= constants[C_MISFIT]
        and doubt > 1.0
        and whole
        and result[R_FAILED] == 0.0
        and jumping(before, spread, found, uncertain, constants) < 0
    ):
        temper(before, spread, found, uncertain, doubt)
    for i in range(LEVEL):
        solved[i] = p[i]
    reshaped = end_update(
        samples, constants, masks[USUAL], before, spread, found, uncertain, whole, mean, covariance,
        p[:KNOTS], result,
    )  # fmt: skip
    through = stick and result[R_END] == count and not reshaped
    for i in range(LEVEL):
        through = through and abs(p[i] - led[i]) <= CLOSE * max(abs(p[i]), 0.5)
        through = through and abs(p[i] - solved[i]) <= NEARLY * math.sqrt(uncertain[i, i])
    if through:  # what little the figures have moved since, the derivatives know
        by_coulomb = units[F_UNIT, COULOMB] * (p[COULOMB] - led[COULOMB])
        by_stiffness = units[F_UNIT, STIFFNESS] * (p[STIFFNESS] - led[STIFFNESS])
        for i in range(n):
            elements[FORCE, i] += by_coulomb * elements[BY_COULOMB, i]
            elements[FORCE, i] += by_stiffness * elements[BY_STIFFNESS, i]
            forces[i] = elements[FORCE, i]
            slips[i] = elements[SLIPS, i] > 0.0
        return
    if reshaped:
        for k in range(count):
            marks[M_READY, k] = 0
    no = n < 0  # not written as False: numba would compile anew what takes it, for a constant
    lead(
        p, units[F_UNIT], constants[C_VS:], constants[C_POSITION_NOISE], constants[C_PERIOD],
        forces, result[R_KNOWN], result[R_REST_FORCE], tables, marks[M_HEADING], marks[M_READY],
        no, no, no, scratch[: KNOTS * count].reshape((KNOTS, count)), elements,
    )  # fmt: skip
    for i in range(n):
        forces[i] = elements[FORCE, i]
        slips[i] = elements[SLIPS, i] > 0.0


@numba.njit(cache=True, error_model="numpy")
def end_update(  # type: ignore[no-untyped-def]
    samples, constants, masks, before, spread, found, uncertain, whole, mean, covariance, p, result
):
    """Decide whether the estimate can be trusted, and of which figures the move says anything.

    Args:
        samples: of the move.
        constants: as above.
        masks: figures that were solved for in zone A, in a move without zone A, and in one that has
            both, shape (3, LEVEL).
        before: belief before the move.
        spread: covariance of it.
        found: belief after it as the solve has it; becomes what is believed.
        uncertain: covariance of it; the same.
        whole: as above; where it is False, belief stays as it was.
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
        result[U_VERDICT], result[U_NUMBER] = HOLES, result[R_STEADY]
    elif result[R_SLIDE] == 0.0 and not stick:
        result[U_VERDICT] = STILL
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


@numba.njit(cache=True, error_model="numpy")
def clean(position, force, valid, rest, x, f, good):  # type: ignore[no-untyped-def]
    """Copy the samples; holes in the position are bridged by a straight line. Returns how many."""
    samples, usable, last = position.shape[0], 0, -1
    # Two loops of few arrays, as a compiler sees through.
    for k in range(samples):
        x[k] = position[k]
        good[k] = valid[k] and abs(position[k]) < math.inf
    for k in range(samples):
        sound = good[k] and abs(force[k]) < math.inf
        f[k] = force[k] if sound else 0.0
        good[k] = sound
        usable += sound
    for k in range(samples if usable < samples else 0):
        if good[k]:
            if last < k - 1:
                # All that it moved stretched its elements, seen or not: from the rest, if known.
                first = max(last, 0)
                begin = x[last] if last >= 0 else rest if math.isfinite(rest) else position[k]
                for j in range(last + 1, k):
                    x[j] = begin + (j - first) / (k - first) * (position[k] - begin)
            last = k
    for j in range(last + 1 if usable < samples else samples, samples):
        x[j] = x[last] if last >= 0 else 0.0
    return usable


@numba.njit(cache=True, error_model="numpy")
def age(mean, covariance, elapsed, restless, constants, units, after, spread):  # type: ignore[no-untyped-def]
    """The belief one move later: the figures drifted, the level partly forgotten."""
    keep = math.exp(-max(elapsed, 0.0) / constants[C_CORRELATION])
    for i in range(LEVEL + 1):
        after[i] = mean[i]
        for j in range(LEVEL + 1):
            spread[i, j] = covariance[i, j]
    after[LEVEL] *= keep
    for i in range(LEVEL):
        spread[i, LEVEL] *= keep
        spread[LEVEL, i] *= keep
        spread[i, i] += units[F_DRIFT, i] ** 2
    spread[COULOMB, COULOMB] += restless * mean[COULOMB] ** 2
    spread[LEVEL, LEVEL] *= keep * keep
    spread[LEVEL, LEVEL] += (1.0 - keep * keep) * constants[C_WANDER] ** 2 + 1e-12


@numba.njit(cache=True, error_model="numpy")
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


@numba.njit(cache=True, error_model="numpy")
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


@numba.njit(cache=True, error_model="numpy")
def sliding(mean, covariance, at, result):  # type: ignore[no-untyped-def]
    """Fc (1 + w), relative, and its variance, into two places of the result."""
    coulomb, level = mean[COULOMB], 1.0 + mean[LEVEL]
    result[at] = coulomb * level
    result[at + 1] = (
        level * level * covariance[COULOMB, COULOMB]
        + 2.0 * level * coulomb * covariance[COULOMB, LEVEL]
        + coulomb * coulomb * covariance[LEVEL, LEVEL]
    )


@numba.njit(cache=True, error_model="numpy")
def asked(figure, masks, report):  # type: ignore[no-untyped-def]
    """Whether a figure was solved for in this move."""
    if report[R_SLIDE] == 0.0:
        return masks[1, figure]
    return masks[2, figure] if report[R_STICK] > 0.0 else masks[0, figure]


@numba.njit(cache=True, error_model="numpy")
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


@numba.njit(cache=True, error_model="numpy")
def rounding_step(force, noise):  # type: ignore[no-untyped-def]
    """The step that all forces are whole multiples of, where it alone makes the noise; else 0.

    A force noise that is nothing but rounding has a step of sqrt(12) times its rms.
    """
    step = noise * math.sqrt(12.0)
    if not step > 0.0:
        return 0.0
    first = force[0]
    for k in range(force.shape[0]):
        codes = (force[k] - first) / step
        if not abs(codes - math.floor(codes + 0.5)) < 1e-3:
            return 0.0
    return step
