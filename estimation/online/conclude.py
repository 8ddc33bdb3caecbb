"""What is believed behind the solves, and how the friction state ends; compiled into `update`."""

from __future__ import annotations

import math

from estimation.compiled import kernel
from estimation.flat_room import as_rows
from estimation.friction.elements import BY_COULOMB, BY_STIFFNESS, ELEMENT_ROWS, FORCE, SLIPS
from estimation.online.arrival_cost import knots_of, wander_on
from estimation.online.belief import COULOMB, LEVEL, STIFFNESS
from estimation.online.judge import MOSTLY, end_update, jumping
from estimation.online.move_tables import KNOTS, M_HEADING, M_READY, MARKS, SPARE, TABLES
from estimation.online.residual import lead
from estimation.online.temper import temper
from estimation.online.update_tables import (
    B_BEFORE,
    B_FOUND,
    B_LED,
    B_SOLVED,
    B_SPREAD,
    B_UNCERTAIN,
    B_UNKNOWNS,
    BELIEFS,
    C_MISFIT,
    C_PERIOD,
    C_POSITION_NOISE,
    C_TYPICAL,
    C_VS,
    C_WANDER,
    F_UNIT,
    R_CHI_A,
    R_CHI_B,
    R_END,
    R_FAILED,
    R_KNOWN,
    R_REST_FORCE,
    R_SLIDE,
    R_STEADY,
    R_STICK,
    U_SLIDING,
    USUAL,
)

UNUSUAL = 1.6
"""A move whose misfit is more than so many times the usual one counts less: what the model misses
in it is not what it misses elsewhere."""
NEARLY, CLOSE = 0.01, 0.02
"""Figures that are what the solve found, to so many standard deviations, and have moved by no more
than that share since the elements were led through the move: the derivatives tell where it ends."""


@kernel()
def square(entries):  # type: ignore[no-untyped-def]
    """A matrix of figures and level out of its row of entries."""
    return as_rows(entries, LEVEL + 1, LEVEL + 1)


@kernel(inline="always")
def settle(  # type: ignore[no-untyped-def]
    samples, whole, constants, units, shares, masks, mean, covariance, forces, slips, beliefs,
    floats, small, result,
):  # fmt: skip
    """Decide what is believed, and carry the friction state to the move's end.

    The arguments are those of `update.update_move`, its axis and its room cut up. Returns the
    variance of the sliding level as expected before the move, relative.
    """
    n, count = shares.shape[0], samples - 2
    begin = SPARE + ELEMENT_ROWS * (n + 1)
    end = begin + TABLES * samples
    elements = as_rows(floats[SPARE:begin], ELEMENT_ROWS, n + 1)
    tables = as_rows(floats[begin:end], TABLES, samples)
    marks = as_rows(small[: MARKS * samples], MARKS, samples)
    scratch = floats[end:]
    before, spread = beliefs[B_BEFORE:B_FOUND], square(beliefs[B_SPREAD:B_UNCERTAIN])
    found, uncertain = beliefs[B_FOUND:B_SPREAD], square(beliefs[B_UNCERTAIN:B_UNKNOWNS])
    knots = knots_of(count, constants[C_PERIOD], constants[C_WANDER])
    p = beliefs[B_UNKNOWNS : B_UNKNOWNS + KNOTS + knots]
    slide, stick = result[R_SLIDE] > 0.0, result[R_STICK] > 0.0
    led, solved = beliefs[B_LED:B_SOLVED], beliefs[B_SOLVED:BELIEFS]
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
    unsure = result[U_SLIDING + 1] / (result[U_SLIDING] * result[U_SLIDING])
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
        return unsure
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
    return unsure
