"""One residual-and-sensitivity evaluation of the estimator, many times: `rows`, `whitening`."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np

from estimation.friction.elements import ELEMENT_ROWS, SHARES
from estimation.friction.gms import element_shares
from estimation.online.belief import COULOMB, LEVEL, MASS, STIFFNESS, VISCOUS, Belief
from estimation.online.move_tables import (
    KNOTS,
    M_GOOD,
    M_HEADING,
    M_READY,
    MARKS,
    RESIDUAL,
    T_FORCE,
    T_HAZE,
    T_POSITION,
    T_STUCK,
    TABLES,
)
from estimation.online.prepare import prepare
from estimation.online.residual import fill_rows
from estimation.online.update_tables import (
    C_FORCE_NOISE,
    C_PERIOD,
    C_POSITION_NOISE,
    C_VS,
    F_UNIT,
    R_END,
    R_KNOWN,
    REPORT_SIZE,
)
from estimation.online.whitening import factor_weights, normal_equations, whiten
from peers.problem import F64, START, ZONE_AB, Problem


def make(problem: Problem, p: F64) -> Callable[[int], float]:
    """A call of so many evaluations at relative figures p; returns chi-square."""
    settings = problem.settings
    constants, units = settings.constants(START), settings.units(START)
    shares, count = element_shares(START.elements), len(problem.velocity)
    mean = Belief.at_start(settings.belief, START).mean
    shares, report = shares.copy(), np.zeros(REPORT_SIZE)
    samples = len(problem.position)
    tables, report[R_KNOWN] = np.empty((TABLES, samples)), START.coulomb
    tables[T_POSITION], tables[T_FORCE] = problem.position, problem.force
    marks = np.zeros((MARKS, samples), np.int8)
    marks[M_GOOD] = 1
    prepare(constants, units, shares, mean, True, True, tables, marks, report)
    heading, ready = marks[M_HEADING], marks[M_READY]
    end = int(report[R_END])
    figures = np.array([COULOMB, VISCOUS, STIFFNESS, MASS])
    relative = np.zeros(KNOTS)
    relative[:LEVEL] = mean[:LEVEL]
    relative[figures] = p
    elements = np.empty((ELEMENT_ROWS, START.elements + 1))
    elements[SHARES, : START.elements] = shares
    rows, weights = np.empty((KNOTS, count))[:, :end], np.empty((4, count))
    use = np.ones(end, dtype=np.bool_)
    use[: problem.rows(ZONE_AB).start] = False
    data = (
        constants, units[F_UNIT], np.zeros(START.elements), tables, heading, ready, rows, elements,
        weights, use, np.append(figures, RESIDUAL),
    )  # fmt: skip

    def call(times: int) -> float:
        return float(_repeat(relative, START.coulomb, data, times))

    return call


@numba.njit(cache=True, error_model="numpy")
def _repeat(p, known, data, times):  # type: ignore[no-untyped-def]
    constants, units, forces, tables, heading, ready, rows, elements, weights, use, chosen = data
    n = chosen.shape[0]
    normal = np.empty((n, n))
    at = p.copy()
    white = constants[C_FORCE_NOISE] ** 2
    for i in range(times):
        at[COULOMB] = p[COULOMB] * (1.0 + 1e-12 * i)
        fill_rows(
            at, 0, units, constants[C_VS:], constants[C_POSITION_NOISE], constants[C_PERIOD],
            forces, known, 0.0, tables, heading, ready, False, i == 0, rows, elements,
        )  # fmt: skip
        if i == 0:
            for k in range(rows.shape[1]):
                weights[3, k] = white + tables[T_HAZE, k]
            factor_weights(
                units[MASS] * p[MASS], units[VISCOUS] * p[VISCOUS], constants[C_PERIOD],
                constants[C_POSITION_NOISE], tables[T_STUCK], weights[3], use, weights[0],
                weights[1], weights[2],
            )  # fmt: skip
        whiten(rows, chosen, weights[0], weights[1])
        normal_equations(rows, chosen, weights[2, : rows.shape[1]], normal)
    return normal[n - 1, n - 1]
