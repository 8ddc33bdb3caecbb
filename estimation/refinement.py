"""From the solution of `window.fit` to the one under the noise as it is, where that matters.

Either a rounded force is taken for the codes it is (`rounding`), or the encoder's noise for what it
leaves in slipping elements (`carried_weights`). Apart from the solve, because it takes long to
compile, and few axes need it.
"""

from __future__ import annotations

from estimation.arrival_cost import knots_of
from estimation.belief import ALPHA, COULOMB, LEVEL, MASS, RATE, STIFFNESS, VISCOUS
from estimation.carried_weights import refine_carried
from estimation.compiled import kernel
from estimation.conclusion import settle, square
from estimation.elements import ELEMENT_ROWS, SHARES
from estimation.flat_room import as_rows
from estimation.move_tables import (
    KNOTS,
    M_HEADING,
    M_READY,
    M_USE,
    MARKS,
    MOST,
    RESIDUAL,
    SPARE,
    T_FORCE,
    T_STUCK,
    TABLES,
)
from estimation.rounding import refine
from estimation.shared_rounding import share_rounding
from estimation.update_tables import (
    AXIS,
    B_BEFORE,
    B_FOUND,
    B_SPREAD,
    B_UNCERTAIN,
    B_UNKNOWNS,
    BELIEFS,
    C_FORCE_NOISE,
    C_MODEL_ERROR,
    C_PERIOD,
    C_POSITION_NOISE,
    C_VS,
    C_WANDER,
    CARRIED,
    CONSTANTS,
    F_UNIT,
    FIGURE_ROWS,
    R_ASKS,
    R_CODES,
    R_KNOWN,
    R_REST_FORCE,
    R_ROWS,
    R_STEP,
    R_STICK,
    R_UNKNOWNS,
    U_MISFIT,
    U_VERDICT,
)
from estimation.window import conclude


@kernel()
def refine_fit(  # type: ignore[no-untyped-def]
    whole, tables, marks, constants, units, forces, prior_mean, prior_covariance, mean, covariance,
    p, elements, room, spare, scratch, report,
):  # fmt: skip
    """Refine the solution that `window.fit` left, on the arrays that it left it in.

    All arguments are those of `fit`, as they came out of it; R_ASKS says which refinement.
    """
    n, end, knots = int(report[R_UNKNOWNS]), int(report[R_ROWS]), p.shape[0] - KNOTS
    chosen = room[: n + 1]
    figures = n - n
    while figures < n and chosen[figures] < LEVEL:
        figures += 1
    prior, lower, upper = spare[:n], spare[n : 2 * n], spare[2 * n : 3 * n]
    value, away = spare[3 * n : 4 * n], spare[4 * n : 5 * n]
    begin, size = 6 * MOST, (n + 1) * (n + 1)
    information = as_rows(spare[begin : begin + n * n], n, n)
    normal = as_rows(spare[begin + size : begin + 2 * size], n + 1, n + 1)
    columns = KNOTS + knots
    rows = as_rows(scratch[: columns * end], columns, end)
    weights = as_rows(scratch[columns * end : (columns + 4) * end], 4, end)
    use = marks[M_USE, :end]
    mass, viscous = units[F_UNIT, MASS] * p[MASS], units[F_UNIT, VISCOUS] * p[VISCOUS]
    spread = constants[C_MODEL_ERROR] * units[F_UNIT, COULOMB] * prior_mean[COULOMB]
    white = constants[C_FORCE_NOISE] ** 2 + spread * spread
    if report[R_ASKS] == CARRIED:
        for k in range(end):
            weights[3, k] = 0.0
        if report[R_CODES] > 0.0:
            share_rounding(
                tables[T_FORCE], rows[RESIDUAL], use, report[R_CODES],
                mass * constants[C_POSITION_NOISE] / constants[C_PERIOD] ** 2, weights[3],
            )  # fmt: skip
        refine_carried(
            rows, chosen, tables, marks[M_HEADING], marks[M_READY], use, mass, viscous,
            units[F_UNIT, COULOMB] * p[COULOMB], units[F_UNIT, STIFFNESS] * p[STIFFNESS],
            units[F_UNIT, RATE] * p[RATE], p[ALPHA], constants[C_VS:],
            constants[C_POSITION_NOISE], constants[C_PERIOD], forces, report[R_KNOWN],
            report[R_REST_FORCE], white, weights[3], elements[SHARES, :-1], prior,
            information, lower, upper, value, normal,
        )  # fmt: skip
    else:
        chi = normal[n, n]
        for k in range(end):
            weights[3, k] -= white
        for a in range(n):
            away[a] = value[a]
        refine(
            rows, chosen, away, tables[T_STUCK], weights[3], use, mass, viscous,
            constants[C_PERIOD], constants[C_POSITION_NOISE], report[R_STEP], prior, information,
            lower, upper, value, normal,
        )  # fmt: skip
        normal[n, n] = chi
    conclude(
        whole, False, figures, knots, chosen, value, lower, upper, normal, information, p,
        prior_mean, prior_covariance, mean, covariance, report,
    )  # fmt: skip


@kernel()
def refine_move(  # type: ignore[no-untyped-def]
    position, force, valid, upset, rest, rest_force, elapsed, restless, state_known, whole, axis,
    masks, mean, covariance, forces, slips, memory, floats, small, result,
):  # fmt: skip
    """Do what `update.update_move` left, where it says UNREFINED; called with the same."""
    samples = position.shape[0]
    constants, shares = axis[:CONSTANTS], axis[AXIS:]
    units = as_rows(axis[CONSTANTS:AXIS], FIGURE_ROWS, LEVEL)
    beliefs, room = floats[:BELIEFS], floats[BELIEFS:]
    begin = SPARE + ELEMENT_ROWS * (shares.shape[0] + 1)
    end = begin + TABLES * samples
    knots = knots_of(samples - 2, constants[C_PERIOD], constants[C_WANDER])
    refine_fit(
        result[R_STICK] > 0.0, as_rows(room[begin:end], TABLES, samples),
        as_rows(small[: MARKS * samples], MARKS, samples), constants, units, forces,
        beliefs[B_BEFORE:B_FOUND], square(beliefs[B_SPREAD:B_UNCERTAIN]), beliefs[B_FOUND:B_SPREAD],
        square(beliefs[B_UNCERTAIN:B_UNKNOWNS]), beliefs[B_UNKNOWNS : B_UNKNOWNS + KNOTS + knots],
        as_rows(room[SPARE:begin], ELEMENT_ROWS, shares.shape[0] + 1), small[MARKS * samples :],
        room[:SPARE], room[end:], result,
    )  # fmt: skip
    doubt = settle(
        samples, whole, constants, units, shares, masks, mean, covariance, forces, slips, beliefs,
        room, small, result,
    )  # fmt: skip
    return int(result[U_VERDICT]), result[U_MISFIT], doubt
