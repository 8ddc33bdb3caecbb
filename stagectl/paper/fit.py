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
from numpy.typing import NDArray

from stagectl.paper.published import Printed
from stagectl.paper.signals import Move
from stagectl.paper.window import (
    NAMES,
    OPTIONS,
    TOTAL,
    ZONE_A,
    ZONE_B,
    Options,
    Problem,
    Solution,
    Window,
)

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Fit(Printed):
    """An estimate of ours.

    Attributes:
        windows: the samples of each.
        predicted: force over the windows [N], shape (samples in all,).
    """

    windows: tuple[Window, ...]
    predicted: F64


def one_window(move: Move, options: Options = OPTIONS) -> Fit:
    """All four parameters over zones A and B at once."""
    window = (move.slide, move.end)
    problem = Problem(move, window, options, slipping=True)
    found = problem.solve(options.first(), (*ZONE_A, *ZONE_B), None)
    return _fit([found], (window,))


def two_windows(move: Move, options: Options = OPTIONS) -> Fit:
    """Fc, C, sigma_v in zone A; then sigma0 in zone B."""
    first = zone_a(move, options.first(), options)
    second = zone_b(move, first.value[:TOTAL], first.left, options)
    return _fit([first, second], ((move.slide, move.turn), (move.turn, move.end)))


def zone_a(move: Move, start: F64, options: Options = OPTIONS) -> Solution:
    """Fc, C, sigma_v from zone A.

    Args:
        move: its samples.
        start: first iterate, shape (4,); known parameters keep it.
        options: of the fit.
    """
    problem = Problem(move, (move.slide, move.turn), options, slipping=True)
    return problem.solve(start, options.slide, None)


def left_by_zone_a(move: Move, known: F64) -> float:
    """Sum of the element forces at zone A's end [N] under parameters taken as known, shape (4,)."""
    problem = Problem(move, (move.slide, move.turn), OPTIONS, slipping=True)
    return problem.follow(known)


def zone_b(move: Move, known: F64, total: float, options: Options = OPTIONS) -> Solution:
    """sigma0 from zone B.

    Args:
        move: its samples.
        known: Fc, C, sigma_v as known, sigma0 as first iterate, shape (4,).
        total: sum of the element forces where zone B begins [N].
        options: of the fit.
    """
    problem = Problem(move, (move.turn, move.end), options, slipping=not options.turned)
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


METHODS: dict[str, Callable[[Move, Options], Fit]] = {
    "one_window": one_window,
    "two_windows": two_windows,
}
