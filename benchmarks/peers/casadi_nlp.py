"""CasADi: the model by single shooting (`mapaccum`), solved by IPOPT or by SQP with qpOASES."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from benchmarks.peers.problem import F64, START, ZONE_A, ZONE_AB, Problem

QUIET_IPOPT = {"ipopt": {"print_level": 0, "sb": "yes"}}
SQP = {
    "qpsol": "qpoases",
    "qpsol_options": {"printLevel": "none", "sparse": False},
    "print_header": False,
    "print_iteration": False,
    "print_status": False,
    "tol_du": 1e-6,
}


def make(problem: Problem, method: str) -> Callable[[], F64]:
    """A complete two-zone estimate by bounded nonlinear programs with exact Hessians."""
    zones = [(np.array(free), _program(problem, free, method)) for free in (ZONE_A, ZONE_AB)]

    def solve() -> F64:
        p = np.ones(4)
        for free, program in zones:
            answer = program(x0=p[free], p=p, lbx=problem.lower, ubx=problem.upper)
            p[free] = np.asarray(answer["x"]).ravel()
        return p

    return solve


def element_step() -> ca.Function:
    """One micro-step: (F, slip flags), (a column of `Steps.table`, Fc, sigma0) -> next."""
    count = START.elements
    state, row = ca.SX.sym("state", 2 * count), ca.SX.sym("row", 8)
    dx, direction, curve, before, decay, reset, coulomb, stiffness = ca.vertsplit(row)
    forces, flags = [], []
    for i in range(count):
        f, slips = state[i], state[count + i] * (1 - reset)
        goal = direction * (2 * (i + 1) / (count * (count + 1))) * curve * coulomb
        stretched = f + stiffness / count * dx
        over = stretched * direction >= ca.fabs(goal)
        begins = ca.logic_and(slips < 0.5, over)
        limit = (2 * (i + 1) / (count * (count + 1))) * before * coulomb
        room = limit - f * direction
        closing = (stretched - f) * direction - (ca.fabs(goal) - limit)
        lands = ca.logic_and(begins, ca.logic_and(room > 0, closing > 0))
        at = ca.fmin(room / ca.if_else(lands, closing, 1.0), 1.0)
        rest = 1 - (1 - at) * (1 - decay)
        landed = goal + (f + at * (stretched - f) - goal) * rest
        slips = ca.if_else(begins, 1.0, slips)
        slid = ca.if_else(lands, landed, goal + (f - goal) * decay)
        forces.append(ca.if_else(slips > 0.5, slid, stretched))
        flags.append(slips)
    return ca.Function("step", [state, row], [ca.vertcat(*forces, *flags)])


def _program(problem: Problem, free: tuple[int, ...], method: str) -> ca.Function:
    steps, rows = problem.steps, problem.rows(free)
    count, used = START.elements, int(steps.last[rows.stop - 1]) + 1
    unknown, known = ca.MX.sym("unknown", len(free)), ca.MX.sym("known", 4)
    p = ca.vertsplit(known)
    for place, i in enumerate(free):
        p[i] = unknown[place]
    figures = [value * float(scale) for value, scale in zip(p, problem.scale, strict=True)]
    data = steps.table(used)
    inputs = ca.vertcat(ca.DM(data), ca.repmat(figures[0], 1, used), ca.repmat(figures[2], 1, used))
    states = element_step().mapaccum("elements", used)(ca.DM.zeros(2 * count), inputs)
    total = ca.horzcat(0.0, ca.sum1(states[:count, :]))
    total = total[:, (steps.last[rows] + 1).tolist()].T
    velocity, acceleration = problem.velocity[rows], problem.acceleration[rows]
    plain = total + figures[1] * velocity + figures[3] * acceleration - problem.force[1:-1][rows]
    factor = problem.factor(rows.stop - rows.start)
    before, row = ca.SX.sym("before", 2), ca.SX.sym("row", 4)
    white = (row[0] - row[2] * before[1] - row[1] * before[0]) / row[3]
    filtered = ca.Function("white", [before, row], [ca.vertcat(before[1], white)])
    whitened = filtered.mapaccum("whitened", len(factor))(
        ca.DM.zeros(2), ca.vertcat(plain.T, ca.DM(factor.T))
    )[1, :]
    away = [(unknown[place] - 1.0) / float(problem.spread[i]) for place, i in enumerate(free)]
    rows_of = ca.vertcat(whitened.T, *away)
    lam, cost = ca.MX.sym("lam"), 0.5 * ca.sumsqr(rows_of)
    problem_of = {"x": unknown, "p": known, "f": cost}
    options = {"print_time": False, "expand": True}
    if method == "ipopt":
        return ca.nlpsol("program", "ipopt", problem_of, options | QUIET_IPOPT)
    # Gauss-Newton: the exact Hessian of a model with kinks misleads the SQP.
    jacobian = ca.jacobian(rows_of, unknown)
    hessian = ca.Function(
        "hessian", [unknown, known, lam, ca.MX(0, 1)], [lam * ca.densify(jacobian.T @ jacobian)],
        ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"],
    ).expand()  # fmt: skip
    return ca.nlpsol("program", "sqpmethod", problem_of, options | SQP | {"hess_lag": hessian})
