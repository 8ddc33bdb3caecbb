"""The paper's estimator: unweighted Gauss-Newton over one window, or over two in turn.

One window: all four parameters over zones A and B at once. Two windows: Fc, C, sigma_v in zone A,
where sigma0 does not enter; then sigma0 in zone B, the rest as found. The element forces begin at
nu_i S(v0) in zone A and at nu_i times zone A's final total in zone B, or their total is another
unknown. Each window minimises sum (u - u_hat)^2, u_hat = m a + sum F_i + sigma_v v, without prior,
p >= 0, over N = 4 elements driven by the measured positions. The model's own unknown is the rate
C/Fc; here it is C, as in the paper. Deviations: MSE (J'J)^-1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from estimation.friction import FrictionState, element_shares, follow
from stagectl.paper import published
from stagectl.paper.case import CASE, Case
from stagectl.paper.published import PARAMETERS, Printed
from stagectl.paper.simulate import Move, prepare
from stagedata import F64, FrictionFigures

Window = tuple[int, int]
"""First sample, and the one after the last."""

TOTAL, ALPHA = len(PARAMETERS), len(PARAMETERS) + 1
"""After the parameters: sum of the element forces at the window's beginning [N]; alpha."""
NAMES = (*PARAMETERS, "total", "static_ratio")
ZONE_B = (3,)
_FLOOR = 1e-6  # lower bound relative to the start: the model needs positive figures
_STEP = 1e-6  # of forward differences, relative to the iterate or to the first one, if larger
_DECREASE = 1e-8  # decrease of the cost, relative, that ends the iteration
_SUBSTEPS = 2
_MAX_ITERATIONS = 60
_HALVINGS = 8
_SHORTENINGS = 40  # a step still outside the bounds after so many halvings ends the iteration


@dataclass(frozen=True, slots=True)
class Solution:
    """One window solved.

    Attributes:
        value: parameters, the window's initial total, alpha; shape (6,).
        free: which of them were unknowns.
        variance: of the free ones, MSE (J'J)^-1, shape (n,).
        residual: u - u_hat, shape (samples,).
        predicted: u_hat, same shape.
        left: sum of the element forces at the window's end [N].
        iterations, evaluations: of the solver.
    """

    value: F64
    free: tuple[int, ...]
    variance: F64
    residual: F64
    predicted: F64
    left: float
    iterations: int
    evaluations: int


class Problem:
    """One window as a least-squares problem.

    Args:
        move: its samples.
        window: which of them.
        case: of the fit.
        slipping: whether all elements slip at the beginning; none does otherwise.
    """

    def __init__(self, move: Move, window: Window, case: Case, slipping: bool) -> None:
        first, last = window
        # The first window begins at its first sample, the second where the first one ended.
        before = first if first == move.slide else first - 1
        self._case = case
        self._slipping = slipping
        self._origin = before == first
        self._start = move.position[before]
        self._position = move.position[before + 1 : last]
        self._between = move.velocity[before + 1 : last]
        self._velocity = move.velocity[first:last]
        self._inertia = published.MASS * move.acceleration[first:last]
        self._force = move.force[first:last]
        ratio = abs(move.velocity[first]) / published.STRIBECK_VELOCITY
        self._rise = math.exp(-(ratio**published.STRIBECK_SHAPE))
        self._period = move.period
        self._size = np.ones(len(NAMES))
        self.evaluations = 0

    def solve(self, start: F64, free: tuple[int, ...], total: float | None) -> Solution:
        """Minimise over the `free` ones of `start`, shape (4,).

        Args:
            start: parameters.
            free: the unknowns among them.
            total: element forces' sum at the beginning [N]; None: by the case, S(v0) if free.
        """
        value = np.append(start, [math.nan if total is None else total, published.STATIC_RATIO])
        if self._case.initial == "free":
            value[TOTAL] = self._begin(value)
            free = (*free, TOTAL)
        self._size = np.abs(value)
        chosen = list(free)
        floor = np.append(_FLOOR * start, [-np.inf, _FLOOR])[chosen]
        largest = np.abs(value[chosen])
        residual, predicted, left = self.evaluate(value)
        cost = float(residual @ residual)
        iterations, decrease = 0, math.inf
        while iterations < _MAX_ITERATIONS and decrease > _DECREASE * cost:
            iterations += 1
            jacobian = self._jacobian(value, chosen, predicted)
            # Columns of about the same size: sigma0 is a thousand times the others.
            scale = np.maximum(np.abs(value[chosen]), _FLOOR * largest)
            lower = np.minimum(floor - value[chosen], 0.0) / scale
            scaled = jacobian * scale
            find_step = _box_step if self._case.bounds == "bounded" else _shortened_step
            step = scale * find_step(scaled, residual, lower)
            for _ in range(_HALVINGS):
                trial = value.copy()
                trial[chosen] += step
                evaluated = self.evaluate(trial)
                trial_cost = float(evaluated[0] @ evaluated[0])
                if trial_cost < cost:
                    break
                step = step / 2
            else:
                break
            decrease = cost - trial_cost
            value, cost = trial, trial_cost
            residual, predicted, left = evaluated
        variance = cost / len(residual) * _inverse_diagonal(jacobian)
        value[TOTAL] = self._begin(value)
        return Solution(
            value, free, variance, residual, predicted, left, iterations, self.evaluations
        )

    def _begin(self, value: F64) -> float:
        """Sum of the element forces at the beginning [N]: as given, or (nan) as the case says."""
        if not math.isnan(value[TOTAL]):
            return float(value[TOTAL])
        if self._case.initial == "measured":
            return float(self._force[0] - self._inertia[0] - value[2] * self._velocity[0])
        fixed = self._case.initial == "reference"
        coulomb = published.REFERENCE["coulomb"] if fixed else value[0]
        alpha = published.STATIC_RATIO if fixed else value[ALPHA]
        return float((1 + alpha * self._rise) * coulomb)

    def evaluate(self, value: F64) -> tuple[F64, F64, float]:
        """Residual, prediction, and the sum of the element forces at the end."""
        self.evaluations += 1
        coulomb, attraction, viscous, stiffness = (float(v) for v in value[:TOTAL])
        friction = FrictionFigures(
            elements=published.MODEL_ELEMENTS,
            coulomb=coulomb,
            viscous=viscous,
            stiffness=stiffness,
            relaxation_rate=attraction / coulomb,
            static_ratio=float(value[ALPHA]),
            stribeck_velocity=published.STRIBECK_VELOCITY,
            stribeck_shape=published.STRIBECK_SHAPE,
        )
        total = self._begin(value)
        state = FrictionState(
            element_shares(friction.elements) * total,
            np.full(friction.elements, self._slipping),
            np.array([1.0, self._start]),
        )
        force, _ = follow(
            friction, state, self._position, self._between, self._period, _SUBSTEPS, band=0.0
        )
        if self._origin:
            force = np.append(total, force)
        predicted = self._inertia + force + value[2] * self._velocity
        return self._force - predicted, predicted, float(force[-1])

    def _jacobian(self, value: F64, free: list[int], predicted: F64) -> F64:
        """Derivatives of the prediction by the free ones, forward differences, (samples, n).

        One evaluation per unknown, as the paper's evaluations count.
        """
        columns = []
        for index in free:
            step = _STEP * max(abs(value[index]), self._size[index])
            moved = value.copy()
            moved[index] += step
            columns.append((self.evaluate(moved)[1] - predicted) / step)
        return np.column_stack(columns)


def _inverse_diagonal(jacobian: F64) -> F64:
    """Diagonal of (J'J)^-1, shape (n,); infinite for an unknown that changes nothing."""
    size: F64 = np.sqrt((jacobian**2).sum(axis=0))
    unit = jacobian / np.where(size > 0, size, 1.0)
    inverse = np.linalg.pinv(unit.T @ unit, hermitian=True).diagonal()
    found = np.full(len(size), np.inf)
    np.divide(inverse, size**2, out=found, where=size > 0)
    return found


def _box_step(jacobian: F64, residual: F64, lower: F64) -> F64:
    """Minimiser of |residual - jacobian step| with step >= `lower`, shape (n,)."""
    step: F64 = lsq_linear(jacobian, residual, (lower, np.inf), method="bvls").x
    return step


def _shortened_step(jacobian: F64, residual: F64, lower: F64) -> F64:
    """Minimiser of |residual - jacobian step|, halved until step >= `lower`, shape (n,)."""
    step = np.asarray(np.linalg.lstsq(jacobian, residual, rcond=None)[0], np.float64)
    for _ in range(_SHORTENINGS):
        if (step >= lower).all():
            return step
        step *= 0.5
    return np.zeros_like(step)


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
    problem = Problem(move, (move.slide, move.turn), CASE, slipping=True)
    return problem.evaluate(np.append(known, [math.nan, published.STATIC_RATIO]))[2]


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
