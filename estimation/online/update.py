"""From the samples of a move to a verdict, compiled.

The samples are cleaned, the belief aged, the force at rest taken as the sum of the element forces,
the zones found (`preparation`) and solved (`window.fit`, once or twice); `conclusion` decides what
is believed, and carries the friction state on. All that is one compiled call on few arrays, cut up
inside: each argument of one costs time.
"""

from __future__ import annotations

import math

from estimation.compiled import kernel
from estimation.flat_room import as_rows
from estimation.friction.elements import ELEMENT_ROWS, SHARES, correct_forces
from estimation.online.arrival_cost import age, knots_of
from estimation.online.belief import ALPHA, COULOMB, LEVEL
from estimation.online.conclude import settle, square
from estimation.online.move_tables import (
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
from estimation.online.prepare import clean, prepare
from estimation.online.solve import fit
from estimation.online.update_tables import (
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
    C_MODEL_ERROR,
    C_PERIOD,
    C_STEP,
    C_WANDER,
    CALM,
    CONSTANTS,
    F_UNIT,
    FIGURE_ROWS,
    R_BOUND,
    R_CODES,
    R_FAILED,
    R_FAR,
    R_KNOWN,
    R_REST_FORCE,
    R_SLIDE,
    R_STICK,
    R_TOLD,
    SHORT,
    U_MISFIT,
    U_NUMBER,
    U_VERDICT,
    UPDATE_SIZE,
    USUAL,
)

FEW, UNEQUAL = -1, -2


@kernel()
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
        The verdict, or less than 0: FEW samples are valid, or the arrays differ (UNEQUAL), and
        nothing is done. The misfit. The variance of the sliding level as expected before the move,
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
    _solve(samples, constants, units, shares, masks, forces, beliefs, room, small, result)
    doubt = settle(
        samples, whole, constants, units, shares, masks, mean, covariance, forces, slips, beliefs,
        room, small, result,
    )  # fmt: skip
    return int(result[U_VERDICT]), result[U_MISFIT], doubt


@kernel(inline="always")
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
    before, spread = beliefs[B_BEFORE:B_FOUND], square(beliefs[B_SPREAD:B_UNCERTAIN])
    found, uncertain = beliefs[B_FOUND:B_SPREAD], square(beliefs[B_UNCERTAIN:B_UNKNOWNS])
    age(mean, covariance, elapsed, restless, constants, units, before, spread)
    correct_forces(
        forces, shares, known * (1.0 + before[LEVEL]) * (1.0 + before[ALPHA]), rest_force
    )
    step, assumed = constants[C_STEP], math.sqrt(12.0) * constants[C_FORCE_NOISE]
    # Where the model misses more than that, rounding is not what matters.
    missed = constants[C_MODEL_ERROR] * known > 2.0 * constants[C_FORCE_NOISE]
    result[R_KNOWN], result[R_REST_FORCE] = known, rest_force
    prepare(constants, units, shares, before, state_known, whole, tables, marks, result)
    result[R_CODES] = step if constants[C_STEP] >= 0.0 else 0.0 if missed else assumed
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


@kernel(inline="always")
def _solve(  # type: ignore[no-untyped-def]
    samples, constants, units, shares, masks, forces, beliefs, floats, small, result
):
    """Solve zone A, and then all that is usable, as far as there is anything to solve."""
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
    before, spread = beliefs[B_BEFORE:B_FOUND], square(beliefs[B_SPREAD:B_UNCERTAIN])
    found, uncertain = beliefs[B_FOUND:B_SPREAD], square(beliefs[B_UNCERTAIN:B_UNKNOWNS])
    knots = knots_of(count, constants[C_PERIOD], constants[C_WANDER])
    p = beliefs[B_UNKNOWNS : B_UNKNOWNS + KNOTS + knots]
    slide, stick = result[R_SLIDE] > 0.0, result[R_STICK] > 0.0
    kind = CALM if result[R_TOLD] == 0.0 else USUAL if result[R_FAR] > 0.0 else SHORT
    sticking = result[R_STICK]
    for both, again in ((False, False), (False, True), (True, False)):
        if again:
            # Where zone A ends on a bound, it was perhaps for taking the encoder for exact; and if
            # not, what is left over all noise says how far the model is from what happened.
            if result[R_BOUND] < 0.0 or not stick:
                continue
            result[R_BOUND], result[R_STICK] = -1.0, 0.0
        if (stick if both else slide) and result[R_BOUND] < 0.0 and result[R_FAILED] == 0.0:
            fit(
                both, tables, marks, constants, units, forces, before, spread, found, uncertain,
                masks[kind, 0 if not both else 2 if slide else 1], p, beliefs[B_LED:B_SOLVED],
                elements, chosen, spare, scratch, result,
            )  # fmt: skip
        if again and result[R_BOUND] < 0.0:
            result[R_STICK] = sticking
