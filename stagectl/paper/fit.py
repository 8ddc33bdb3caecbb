"""The paper's estimator: unweighted Gauss-Newton over one window, or over two in turn.

One window: all four parameters over zones A and B at once. Two windows: Fc, C, sigma_v in zone A,
where sigma0 does not enter; then sigma0 in zone B, the rest as found. The element forces begin at
nu_i S(v0) in zone A and at nu_i times zone A's final total in zone B, or their total is another
unknown. `window` states and solves the problem.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stagectl.paper.case import CASE, Case
from stagectl.paper.published import Printed
from stagectl.paper.signals import Move, prepare
from stagectl.paper.window import NAMES, TOTAL, ZONE_B, Problem, Solution, Window
from stagedata import F64


@dataclass(frozen=True, slots=True)
class Fit(Printed):
    """An estimate of ours.

    Attributes:
        windows: the samples of each.
        predicted: force over the windows [N], shape (samples in all,).
    """

    windows: tuple[Window, ...]
    predicted: F64


def one_window(move: Move, case: Case = CASE) -> Fit:
    """All four parameters over zones A and B at once."""
    window = (move.slide, move.end)
    problem = Problem(move, window, case, slipping=True)
    return _fit([problem.solve(np.array(case.start), (0, 1, 2, *ZONE_B), None)], (window,))


def two_windows(move: Move, case: Case = CASE) -> Fit:
    """Fc, C, sigma_v in zone A; then sigma0 in zone B."""
    first = zone_a(move, np.array(case.start), case)
    second = zone_b(move, first.value[:TOTAL], first.left, case)
    return _fit([first, second], ((move.slide, move.turn), (move.turn, move.end)))


def zone_a(move: Move, start: F64, case: Case = CASE) -> Solution:
    """Fc, C, sigma_v from zone A.

    Args:
        move: its samples.
        start: first iterate, shape (4,); known parameters keep it.
        case: of the fit.
    """
    problem = Problem(move, (move.slide, move.turn), case, slipping=True)
    return problem.solve(start, case.slide, None)


def left_by_zone_a(move: Move, known: F64) -> float:
    """Sum of the element forces at zone A's end [N] under parameters taken as known, shape (4,)."""
    return Problem(move, (move.slide, move.turn), CASE, slipping=True).follow(known)


def zone_b(move: Move, known: F64, total: float, case: Case = CASE) -> Solution:
    """sigma0 from zone B.

    Args:
        move: its samples.
        known: Fc, C, sigma_v as known, sigma0 as first iterate, shape (4,).
        total: sum of the element forces where zone B begins [N].
        case: of the fit.
    """
    problem = Problem(move, (move.turn, move.end), case, slipping=not case.turned)
    return problem.solve(known, ZONE_B, total)


def _fit(windows: list[Solution], borders: tuple[Window, ...]) -> Fit:
    value, sigma = {}, {}
    for solution in windows:
        for index, variance in zip(solution.free, solution.variance, strict=True):
            if index != TOTAL:
                value[NAMES[index]] = float(solution.value[index])
                sigma[NAMES[index]] = math.sqrt(max(float(variance), 0.0))
    residual = np.concatenate([solution.residual for solution in windows])
    return Fit(
        value,
        sigma,
        float(residual @ residual) / len(residual),
        tuple(solution.iterations for solution in windows),
        tuple(solution.evaluations for solution in windows),
        borders,
        np.concatenate([solution.predicted for solution in windows]),
    )


METHODS: dict[str, Callable[[Move, Case], Fit]] = {
    "one_window": one_window,
    "two_windows": two_windows,
}


def fit(case: Case, method: str) -> Fit:
    """Simulate a case, and fit it by one of `METHODS`."""
    return METHODS[method](prepare(case), case)
