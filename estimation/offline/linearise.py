"""Residual of all records of an axis and its normal equations, block by block.

The residual is the force predicted minus measured. Each block has unknowns of its own, its knots:
the level's, and last a factor on the state that it starts from, which was left at another level.
They are eliminated inside the block (Schur complement), so what is left is a problem in the n
unknowns that all blocks share. Shapes: M samples of a block, K knots with the last one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.friction import REST_BAND
from estimation.offline.model import (
    Figures,
    Level,
    Path,
    Prediction,
    State,
    lead,
    make_prediction,
    make_state,
)
from estimation.offline.records import OfflineSettings, Record
from estimation.offline.unknowns import (
    ALPHA,
    ASYMMETRY,
    COULOMB,
    DELTA,
    FIGURES,
    LAG,
    MASS,
    OFFSET,
    RATE,
    RIPPLE,
    STIFFNESS,
    VISCOUS,
    VS,
    Unknowns,
)
from estimation.offline.whiten import sum_whitened
from stagedata import F64

KNOT_SPACING = 0.03
"""Of the level's knots [s]."""
_IN_MODEL = [COULOMB, STIFFNESS, RATE, ALPHA, VS, DELTA, ASYMMETRY]
"""Unknowns in the order of `model.Figures`."""


@dataclass(frozen=True, slots=True)
class Point:
    """The point at which the residual is linearised.

    Attributes:
        q: unknowns in their scales, shape (n,).
        levels: knots of every block, shapes (K,).
        index: which unknowns to differentiate by, shape (a,).
        errors_in_variables: take the measured acceleration for as noisy as the residual.
    """

    q: F64
    levels: tuple[F64, ...]
    index: NDArray[np.int64]
    errors_in_variables: bool = False


class NormalEquations:
    """Sums over blocks at a point, knots eliminated.

    Attributes:
        curvature, slope: J'J and J'r, shapes (a, a), (a,).
        scores: the slope by block, shape (blocks, a).
        costs: by block, chi-square of residual and of the knots under their prior, shape (blocks,).
        cost: their sum.  chi: of the residuals alone.  samples: how many.
    """

    def __init__(self, unknowns: int, blocks: int) -> None:
        self.curvature, self.slope = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
        self.scores = np.zeros((blocks, unknowns))
        self.costs = np.zeros(blocks)
        self.chi, self.cost, self.samples = 0.0, 0.0, 0
        # Of each block, A and b of its knots' step: -(A step + b).
        self._back: list[tuple[F64, F64]] = []

    def add(self, sums: tuple[F64, F64, float, int], prior: F64, level: F64) -> None:
        """The next block: `sum_whitened` with the knots last; their information and value."""
        normal, slope, chi, samples = sums
        n = len(self.slope)
        pull = slope[n:] + prior @ level
        columns = np.column_stack([normal[n:, :n], pull])
        solved: F64 = np.linalg.solve(normal[n:, n:] + prior, columns).astype(np.float64)
        per_unknown, rest = solved[:, :n], solved[:, n]
        number = len(self._back)
        self.curvature += normal[:n, :n] - normal[:n, n:] @ per_unknown
        self.scores[number] = slope[:n] - normal[:n, n:] @ rest
        self.slope += self.scores[number]
        self.costs[number] = chi + float(level @ prior @ level)
        self.cost += self.costs[number]
        self.chi += chi
        self.samples += samples
        self._back.append((per_unknown, rest))

    def skip(self, knots: int) -> None:
        """The next block does not count."""
        self._back.append((np.zeros((knots, len(self.slope))), np.zeros(knots)))

    def knot_steps(self, step: F64) -> list[F64]:
        """Step of every block's knots that belongs to a step of the unknowns, shape (a,)."""
        return [-(per_unknown @ step + rest) for per_unknown, rest in self._back]


class Residual:
    """Residual of all records of an axis.

    Args:
        records: of the axis.
        unknowns: what it depends on.
        settings: its noise.

    Attributes:
        knots: K of every block.
    """

    def __init__(
        self, records: Sequence[Record], unknowns: Unknowns, settings: OfflineSettings
    ) -> None:
        self._records, self._unknowns, self._settings = records, unknowns, settings
        self.knots = [self._count_knots(end - begin) for r in records for begin, end in r.blocks]
        self._priors = [self._knot_information(k) for k in self.knots]

    def linearise(self, at: Point, counted: Sequence[bool]) -> NormalEquations:
        """Normal equations at a point; `counted`: blocks that count."""
        u, period = self._unknowns, self._settings.period
        values = u.scale * at.q
        springs, shares = u.shape(at.q)
        figures = Figures._make([*values[_IN_MODEL], springs, shares])
        result = NormalEquations(len(at.index), len(self.knots))
        number = 0
        for record in self._records:
            state = make_state(record.position[0], u.elements, 2, 0)
            for begin, end in record.blocks:
                path = Path(
                    record.position[begin + 1 : end + 1], record.velocity[begin:end], period,
                    REST_BAND,
                )  # fmt: skip
                if counted[number]:
                    level = at.levels[number]
                    prediction = _predict(figures, level, path, state)
                    rows = self._rows(at, record, (begin, end), prediction)
                    sums = self._whiten(at, rows, record.used[begin:end])
                    result.add(sums, self._priors[number], level)
                else:
                    result.skip(self.knots[number])
                number += 1
                # What the next block starts from: this one without wander.
                still = Level(np.zeros(2), 2.0 * (end - begin) * period)
                room = make_prediction(end - begin, u.elements, 2, 0)
                lead(figures, still, path, state, room)
        return result

    def _rows(
        self, at: Point, record: Record, block: tuple[int, int], prediction: Prediction
    ) -> F64:
        """Jacobian by unknowns (in scales) and knots, then the residual [N]: (M, a + K + 1).

        The force is measured `lag` late: force and derivatives are shifted along their own slope.
        """
        begin, end = block
        u, index = self._unknowns, at.index
        values = u.scale * at.q
        velocity, ripple = record.velocity[begin:end], record.ripple[begin:end] * u.scale[MASS]
        by_value = np.zeros((end - begin, len(u.names)))
        by_value[:, _IN_MODEL] = prediction.by_figures
        by_value[:, VISCOUS] = velocity
        by_value[:, MASS] = record.acceleration[begin:end]
        by_value[:, OFFSET] = 1.0
        by_value[:, RIPPLE] = ripple
        by_value[:, len(FIGURES) :] = np.hstack([prediction.by_springs, prediction.by_shares])
        linear = [VISCOUS, MASS, OFFSET, *RIPPLE]
        force = prediction.force + by_value[:, linear] @ values[linear]
        rows = np.column_stack(
            [
                by_value @ u.slopes(at.q)[:, index],
                prediction.by_knots, prediction.by_start, force,
            ]
        )  # fmt: skip
        rise = (rows[2:] - rows[:-2]) / (2.0 * self._settings.period)
        rows[1:-1] -= values[LAG] * rise
        rows[1:-1, : len(index)][:, index == LAG] = -rise[:, -1:] * u.scale[LAG]
        rows[:, -1] -= record.force[begin + 1 : end + 1]
        return rows

    def _whiten(self, at: Point, rows: F64, used: NDArray[np.bool_]) -> tuple[F64, F64, float, int]:
        """Sums of a block's whitened rows; with errors in variables if the mass is free."""
        own, scale = self._settings, self._unknowns.scale[MASS]
        mass = scale * at.q[MASS] if at.errors_in_variables else scale
        noisy = np.flatnonzero((at.index == MASS) & at.errors_in_variables)
        sums: tuple[F64, F64, float, int] = sum_whitened(
            rows, used, (mass * own.position_noise / own.period**2) ** 2,
            own.force_noise**2 + (own.model_error * self._unknowns.scale[COULOMB]) ** 2,
            int(noisy[0]) if len(noisy) else -1, scale / mass,
        )  # fmt: skip
        return sums

    def _count_knots(self, samples: int) -> int:
        return max(2, 1 + math.ceil(samples * self._settings.period / KNOT_SPACING)) + 1

    def _knot_information(self, count: int) -> F64:
        """Inverse prior covariance of a block's knots, shape (K, K).

        A stationary Gauss-Markov process, and the factor on the state at the start, as uncertain.
        """
        variance = max(self._settings.wander, 1e-6) ** 2
        keep = math.exp(-KNOT_SPACING / self._settings.correlation_time)
        walk = (1.0 - keep**2) * variance
        matrix = np.zeros((count, count))
        matrix[0, 0] = matrix[-1, -1] = 1.0 / variance
        for j in range(count - 2):
            matrix[j, j] += keep**2 / walk
            matrix[j, j + 1] = matrix[j + 1, j] = -keep / walk
            matrix[j + 1, j + 1] += 1.0 / walk
        return matrix


def _predict(figures: Figures, level: F64, path: Path, state: State) -> Prediction:
    """Friction along a block from `state`, which stays as it is; `level`: the knots, (K,)."""
    elements, knots = len(state.forces), len(level) - 1
    factor = 1.0 + level[-1]
    own = State(
        state.forces * factor, state.slipping.copy(), state.by_figures * factor,
        np.zeros((elements, knots)), state.forces[:, None].copy(), state.last.copy(),
    )  # fmt: skip
    prediction = make_prediction(len(path.position), elements, knots, 1)
    lead(figures, Level(level[:-1], KNOT_SPACING), path, own, prediction)
    return prediction
