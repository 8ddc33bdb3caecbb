"""One residual-and-sensitivity evaluation of the estimator, many times: `window`."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np

from estimation.belief import COULOMB, LEVEL, MASS, STIFFNESS, VISCOUS
from estimation.gms import element_shares
from estimation.window import normal_equations
from estimation.zones import STICK
from peers.problem import F64, START, Problem


def make(problem: Problem, p: F64) -> Callable[[int], float]:
    """A call of so many evaluations at relative figures p; returns chi-square."""
    settings = problem.settings
    figures = np.array([*problem.scale[:3], START.relaxation_rate, problem.scale[3]])
    data = (
        problem.position, problem.velocity, problem.acceleration, problem.force,
        np.ones(len(problem.zone), dtype=np.bool_), problem.zone, settings.vector(), figures,
        START.vector(), element_shares(START.elements), START.coulomb, np.zeros(START.elements),
        np.zeros(START.elements, dtype=np.bool_), 0.0, 0.0,
    )  # fmt: skip
    active = np.array([COULOMB, VISCOUS, STIFFNESS, MASS])
    relative = np.ones(LEVEL)
    relative[active] = p
    white = settings.force_noise**2

    def call(times: int) -> float:
        return float(_repeat(relative, active, white, data, times))

    return call


@numba.njit(cache=True)
def _repeat(p, active, white, data, times):  # type: ignore[no-untyped-def]
    curvature, slope = np.empty((active.shape[0], active.shape[0])), np.empty(active.shape[0])
    at, chi = p.copy(), 0.0
    for i in range(times):
        at[0] = p[0] * (1.0 + 1e-12 * i)
        chi, _ = normal_equations(at, active, STICK, 0, white, data, curvature, slope)
    return chi
