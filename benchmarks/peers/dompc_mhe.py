"""do-mpc's moving-horizon estimator (multiple shooting, IPOPT) on the same whitened problem.

do-mpc knows noise per measurement only: the whitened residual is therefore a state of the model,
its measurement is zero. What a sample's micro-steps need comes as time-varying parameters.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.peers.casadi_nlp import element_step
from benchmarks.peers.problem import F64, START, SUBSTEPS, TRUE, ZONE_A, ZONE_AB, Problem

with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
    warnings.simplefilter("ignore")
    import do_mpc

WIDTH = 6
COLUMNS = WIDTH * SUBSTEPS
"""Of the micro-steps; then velocity, acceleration, force, factor (3), counts, not the first."""


def make(problem: Problem) -> Callable[[], F64]:
    """A complete two-zone estimate by two estimators, zone A's answer handed to the second."""
    zones = [(free, _estimator(problem, free)) for free in (ZONE_A, ZONE_AB)]

    def solve() -> F64:
        p = np.ones(4)
        for free, mhe in zones:
            for i in free:
                mhe.p_est0[f"p{i}"] = 1.0
            mhe.set_initial_guess()
            for i in free:
                mhe.opt_x_num["_p_est", f"p{i}"] = p[i]
            mhe.make_step(np.zeros((1, 1)))
            for i in free:
                p[i] = float(mhe.opt_x_num["_p_est", f"p{i}"])
        return p

    return solve


def _rows(problem: Problem, free: tuple[int, ...]) -> F64:
    """Time-varying parameters of every inner sample up to the zone's last one."""
    steps, rows = problem.steps, problem.rows(free)
    table = np.zeros((rows.stop, COLUMNS + 8))
    columns, done = steps.table(len(steps.dx)).T, 0
    for k in range(rows.stop):
        for j in range(SUBSTEPS):
            still = 1.0 + TRUE.static_ratio
            idle = (0.0, steps.direction[max(done - 1, 0)], still, still, 1.0, 0.0)
            taken = done <= steps.last[k]
            table[k, WIDTH * j : WIDTH * (j + 1)] = columns[done] if taken else idle
            done += taken
    table[:, COLUMNS] = problem.velocity[: rows.stop]
    table[:, COLUMNS + 1] = problem.acceleration[: rows.stop]
    table[:, COLUMNS + 2] = problem.force[1 : rows.stop + 1]
    table[:, COLUMNS + 5] = 1.0
    table[rows, COLUMNS + 3 : COLUMNS + 6] = problem.factor(rows.stop - rows.start)
    table[rows, COLUMNS + 6] = 1.0
    table[1:, COLUMNS + 7] = 1.0
    return table


def _estimator(problem: Problem, free: tuple[int, ...]) -> Any:
    table, count = _rows(problem, free), START.elements
    model = do_mpc.model.Model("discrete", "SX")
    state = model.set_variable("_x", "elements", (2 * count, 1))
    white = model.set_variable("_x", "white", (2, 1))
    row = model.set_variable("_tvp", "row", (table.shape[1], 1))
    p = [model.set_variable("_p", f"p{i}") for i in range(4)]
    figures = [value * float(scale) for value, scale in zip(p, problem.scale, strict=True)]
    step, keep = element_step(), row[COLUMNS + 7]
    after = state * keep
    for j in range(SUBSTEPS):
        micro = row[WIDTH * j : WIDTH * (j + 1)]
        after = step(after, ca.vertcat(micro, figures[0], figures[2]))
    velocity, acceleration, force, second, first, pivot, counts = ca.vertsplit(row[COLUMNS:-1])
    plain = ca.sum1(after[:count]) + figures[1] * velocity + figures[3] * acceleration - force
    before = white * keep
    new = counts * (plain - first * before[1] - second * before[0]) / pivot
    model.set_rhs("elements", after)
    model.set_rhs("white", ca.vertcat(before[1], new))
    model.set_meas("white", white[1], meas_noise=True)
    model.setup()
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        mhe = do_mpc.estimator.MHE(model, [f"p{i}" for i in free])
        mhe.settings.n_horizon = len(table)
        mhe.settings.t_step = 1.0
        mhe.settings.meas_from_data = False
        mhe.settings.nlpsol_opts = {
            "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0, "expand": True,
        }  # fmt: skip
        weights = np.diag([1.0 / problem.spread[i] ** 2 for i in free])
        mhe.set_default_objective(1e-9 * np.eye(2 * count + 2), np.eye(1), weights)
        _supply(mhe, table, free, len(p))
        for i in free:
            mhe.bounds["lower", "_p_est", f"p{i}"] = problem.lower
            mhe.bounds["upper", "_p_est", f"p{i}"] = problem.upper
        mhe.setup()
    return mhe


def _supply(mhe: Any, table: F64, free: tuple[int, ...], unknowns: int) -> None:
    """The data, as functions of a time that is not used: the record is always this one."""
    rows, fixed, measured = mhe.get_tvp_template(), mhe.get_p_template(), mhe.get_y_template()
    for k in range(len(table)):
        rows["_tvp", k, "row"] = table[k]
    for i in set(range(unknowns)) - set(free):
        fixed[f"p{i}"] = 1.0
    mhe.set_tvp_fun(lambda _: rows)
    mhe.set_p_fun(lambda _: fixed)
    mhe.set_y_fun(lambda _: measured)
