"""One residual-and-sensitivity evaluation of the estimator, many times: `residual`, `whitening`."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np

from benchmarks.peers.problem import F64, START, ZONE_AB, Problem
from estimation.friction import count_states, make_constants
from estimation.online.belief.belief import KNOTS, RESIDUAL
from estimation.online.belief.belief import COULOMB, LEVEL, MASS, STIFFNESS, VISCOUS, Belief
from estimation.online.solver.prepare import Sampled, prepare
from estimation.online.solver.residual import AtRest, fill_rows, make_rows
from estimation.online.solver.whitening import (
    factor_weights,
    make_weights,
    normal_equations,
    whiten,
)


def make(problem: Problem, p: F64) -> Callable[[int], float]:
    """Evaluate repeatedly at relative figures p; returns chi-square."""
    axis, law = problem.settings.axis(START), make_constants(START)
    mean = Belief.at_start(problem.settings.belief, START).mean
    valid, none = np.ones(len(problem.position), dtype=np.bool_), np.zeros(0, dtype=np.bool_)
    sampled = Sampled(problem.position, problem.force, valid, none, 0.0, 0.0)
    prepared = prepare(sampled, axis, law, START.coulomb, mean, True, True)
    figures = np.array([COULOMB, VISCOUS, STIFFNESS, MASS])
    relative = np.zeros(KNOTS)
    relative[:LEVEL] = mean[:LEVEL]
    relative[figures] = p
    use = np.ones(prepared.end, dtype=np.bool_)
    use[: problem.rows(ZONE_AB).start] = False
    rest = AtRest(np.zeros(count_states(START)), START.coulomb, 0.0)
    chosen = np.append(figures, RESIDUAL)

    def call(times: int) -> float:
        return float(_repeat(relative, axis, law, prepared.samples, rest, use, chosen, times))

    return call


@numba.njit(error_model="numpy")  # not cached: the cache does not see changed callees
def _repeat(p, axis, law, samples, rest, use, chosen, times):  # type: ignore[no-untyped-def]
    n, count = chosen.shape[0], use.shape[0]
    normal, at = np.empty((n, n)), p.copy()
    rows = make_rows(0, 0, np.empty(0), count)
    weights, white = make_weights(count), np.empty(count)
    for i in range(times):
        at[COULOMB] = p[COULOMB] * (1.0 + 1e-12 * i)
        fill_rows(at, axis, law, samples, rest, 0, False, rows)
        if i == 0:
            for k in range(count):
                white[k] = axis.force_noise**2 + rows.variance[k]
            factor_weights(
                axis.unit[MASS] * p[MASS], axis.unit[VISCOUS] * p[VISCOUS], axis.period,
                axis.position_noise, rows.spring, white, use, weights,
            )  # fmt: skip
        whiten(rows.columns, chosen, weights)
        normal_equations(rows.columns, chosen, weights, normal)
    return normal[n - 1, n - 1]
