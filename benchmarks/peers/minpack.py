"""scipy's MINPACK on the estimator's own compiled model; it knows no bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares, leastsq

from peers.problem import F64, ZONE_A, ZONE_AB, Problem, compiled_residual


def make(problem: Problem, method: str) -> Callable[[], F64]:
    """A complete two-zone estimate by `leastsq` or by `least_squares(method="lm")`.

    Derivatives by MINPACK's forward differences: the model's residual is a single compiled call.
    """
    solvers = [_Zone(problem, free, method) for free in (ZONE_A, ZONE_AB)]

    def solve() -> F64:
        p = np.ones(4)
        for zone in solvers:
            p = zone.solve(p)
        return p

    return solve


class _Zone:
    def __init__(self, problem: Problem, free: tuple[int, ...], method: str) -> None:
        self.free, self.method = np.array(free), method
        self.arguments = problem.arguments(free)
        rows = problem.rows(free)
        self.count = rows.stop - rows.start + len(free)

    def solve(self, start: F64) -> F64:
        p = start.copy()

        def residual(values: F64) -> F64:
            p[self.free] = values
            out = np.empty(self.count)
            compiled_residual(p, *self.arguments, out)
            return out

        if self.method == "leastsq":
            found, _ = leastsq(residual, start[self.free], ftol=1e-8, xtol=1e-8)
        else:
            found = least_squares(residual, start[self.free], method="lm").x
        p[self.free] = found
        return p
