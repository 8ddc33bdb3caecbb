"""From the samples of a move to a verdict, compiled.

The samples are cleaned, the belief aged, the force at rest taken as the sum of the element forces,
the zones found (`preparation`) and solved (`window.fit`, once or twice); `judgement` decides what
is believed, and the friction state is carried on. All that is one compiled call on few arrays, cut
up inside: each argument of one costs time.
"""

from __future__ import annotations

import math

import numba

from estimation.arrival_cost import age, knots_of, wander_on
from estimation.belief import ALPHA, COULOMB, LEVEL, MASS, STIFFNESS
from estimation.elements import (
    BY_COULOMB,
    BY_STIFFNESS,
    ELEMENT_ROWS,
    FORCE,
    SHARES,
    SLIPS,
    correct_forces,
)
from estimation.flat_room import as_rows
from estimation.judgement import MOSTLY, end_update, jumping
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
from estimation.preparation import clean, prepare, rounding_step
from estimation.rows import lead
from estimation.tempering import temper
from estimation.update_tables import (
    AXIS,
    B_BEFORE,
    B_FOUND,
    B_LED,
    B_SOLVED,
    B_SPREAD,
    B_UNCERTAIN,
    B_UNKNOWNS,
    BELIEFS,
    C_FORCE_NOISE,
    C_MISFIT,
    C_MODEL_ERROR,
    C_PERIOD,
    C_POSITION_NOISE,
    C_STEP,
    C_TYPICAL,
    C_VS,
    C_WANDER,
    CONSTANTS,
    F_UNIT,
    FIGURE_ROWS,
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
    U_MISFIT,
    U_NUMBER,
    U_SLIDING,
    U_VERDICT,
    UPDATE_SIZE,
)
from estimation.window import QUIET, fit

UNUSUAL = 1.6
"""A move whose misfit is more than so many times the usual one counts less: what the model misses
in it is not what it misses elsewhere."""
NEARLY, CLOSE = 0.01, 0.02
"""Figures that are what the solve found, to so many standard deviations, and have moved by no more
than that share since the elements were led through the move: the derivatives tell where it ends."""

FEW, UNEQUAL = -1, -2

# Which figures are solved for: usually, in moves that do not go far, in those that settle at once.
USUAL, SHORT, CALM = range(3)


@numba.njit(cache=True, error_model="numpy")
def update_move(  # type: ignore[no-untyped-def]
    position, force, valid, upset, rest, rest_force, elapsed, restless, state_known, whole, axis,
    masks, mean, covariance, forces, slips, memory, floats, small, result,
):  # fmt: skip
    """Learn from a move, and carry the friction state to its end.

    Args:
        position: sampled [m], shape (K,).
        force: measured [N], shape (K,).
        valid: samples that can be used, shape (K,).
        upset: those of which only the position counts, shape (K,); none: shape (0,).
        rest: position there [m], where the first sample may be lost; nan: not known.
        rest_force: measured at rest before the move [N].
        elapsed: since the end of the last move [s]; negative: there was none.
        restless: variance by which Coulomb force ages beside its drift, relative.
        state_known: False where only the sum of the element forces is known; so it is where neither
            the rest's position nor the first sample is.
        whole: False for a look at a move that is not over: zone A only.
        axis: C_*, F_* row by row, and nu_i, shape (AXIS + N,).
        masks: figures to solve for in zone A, in a move without zone A, and in one that has both:
            usually, in moves that do not go far, in those that settle at once, shape (3, 3, LEVEL).
        mean: belief after the last move, shape (LEVEL + 1,); updated, unless the move is not over.
        covariance: of it; the same.
        forces: element forces at rest before the move [N], shape (N,); become those at its end.
        slips: which elements slip there, written, shape (N,).
        memory: of the friction state; becomes that at the end of the move.
        floats: room, shape (>= BELIEFS + `floats_for(K, N)`,).
        small: the same, shape (>= `marks_for(K)`,).
        result: U_*, written.

    Returns:
        The verdict, or less than 0 where nothing is done: FEW samples are valid, or the arrays
        differ (UNEQUAL). The misfit. The variance of the sliding level as expected before the move,
        relative.
    """
    samples = position.shape[0]
    if force.shape[0] != samples or valid.shape[0] != samples:
        return UNEQUAL, 0.0, 0.0
    if upset.shape[0] != samples and upset.shape[0] != 0:
        return UNEQUAL, 0.0, 0.0
    # An onset of which the beginning is not known says nothing.
    known = state_known and samples > 0 and (not math.isnan(rest) or valid[0])
    constants, shares = axis[:CONSTANTS], axis[AXIS:]
    units = as_rows(axis[CONSTANTS:AXIS], FIGURE_ROWS, LEVEL)
    beliefs, room = floats[:BELIEFS], floats[BELIEFS:]
    counted = _begin(
        position, force, valid, upset, rest, rest_force, elapsed, restless, known, whole,
        constants, units, shares, mean, covariance, forces, memory, beliefs, room, small, result,
    )  # fmt: skip
    if counted < 3:
        return FEW, 0.0, 0.0
    _learn(
        samples, whole, constants, units, shares, masks, mean, covariance, forces, slips, beliefs,
        room, small, result,
    )  # fmt: skip
    doubt = result[U_SLIDING + 1] / (result[U_SLIDING] * result[U_SLIDING])
    return int(result[U_VERDICT]), result[U_MISFIT], doubt


@numba.njit(cache=True, error_model="numpy", inline="always")
def _begin(  # type: ignore[no-untyped-def]
    position, force, valid, upset, rest, rest_force, elapsed, restless, state_known, whole,
    constants, units, shares, mean, covariance, forces, memory, beliefs, floats, small, result,
):  # fmt: skip
    """Clean the samples, age the belief, correct the state by the force at rest, find the zones.

    `constants` are C_*, `units` F_*, `shares` nu_i; `beliefs`, B_*, become the belief before this
    move, where belief after it begins, and the first iterate of the solves. Of `floats` and `small`
    T_* and M_* of the data are written, of `result` R_*, and U_NUMBER becomes the number of valid
    samples. Returns that number; nothing else is done where there are fewer than three.
    """
    for i in range(UPDATE_SIZE):
        result[i] = 0.0
    samples = position.shape[0]
    begin = SPARE + ELEMENT_ROWS * (shares.shape[0] + 1)
    tables = as_rows(floats[begin : begin + TABLES * samples], TABLES, samples)
    marks = as_rows(small[: MARKS * samples], MARKS, samples)
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
    marks[M_READY] = 0
    k = samples - 3
    while k >= 0 and marks[M_HEADING, k] == 0:
        k -= 1
    if k >= 0:
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
    return as_rows(entries, LEVEL + 1, LEVEL + 1)


@numba.njit(cache=True, error_model="numpy", inline="always")
def _learn(  # type: ignore[no-untyped-def]
    samples, whole, constants, units, shares, masks, mean, covariance, forces, slips, beliefs,
    floats, small, result,
):  # fmt: skip
    """Solve the zones, decide what is believed, and carry the friction state to the move's end."""
    n, count = shares.shape[0], samples - 2
    begin = SPARE + ELEMENT_ROWS * (n + 1)
    end = begin + TABLES * samples
    elements = as_rows(floats[SPARE:begin], ELEMENT_ROWS, n + 1)
    tables = as_rows(floats[begin:end], TABLES, samples)
    marks = as_rows(small[: MARKS * samples], MARKS, samples)
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
    # What was found holds at the move's end: so must what it is compared with.
    duration = (count - 1) * constants[C_PERIOD]
    wander_on(before, spread, duration, constants)
    if not slide and not stick:
        wander_on(found, uncertain, duration, constants)
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
        no, no, no, as_rows(scratch[: KNOTS * count], KNOTS, count), elements,
    )  # fmt: skip
    for i in range(n):
        forces[i] = elements[FORCE, i]
        slips[i] = elements[SLIPS, i] > 0.0
