"""scipy's MINPACK on the estimator's own compiled model; it knows no bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares, leastsq

from benchmarks.peers.problem import (
    F64,
    ZONE_A,
    ZONE_AB,
    Problem,
    compiled_jacobian,
    compiled_residual,
)


def make(problem: Problem, method: str) -> Callable[[], F64]:
    """A complete two-zone estimate by MINPACK; residual and derivatives are a compiled call each.

    Args:
        problem: of all peers.
        method: "differences" and "derivatives" are `leastsq`, with MINPACK's forward differences
            and with the model's own sensitivities; "least_squares" is method="lm", by differences.
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

        def derivatives(values: F64) -> F64:
            p[self.free] = values
            out = np.empty((len(self.free), self.count))
            compiled_jacobian(p, *self.arguments, out)
            return out

        if self.method == "differences":
            found, _ = leastsq(residual, start[self.free], ftol=1e-8, xtol=1e-8)
        elif self.method == "derivatives":
            found, _ = leastsq(
                residual, start[self.free], Dfun=derivatives, col_deriv=True, ftol=1e-8, xtol=1e-8
            )
        else:
            found = least_squares(residual, start[self.free], method="lm").x
        p[self.free] = found
        return p
