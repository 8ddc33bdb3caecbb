"""Least squares that is fitted to all groups of samples but one, and judged on that one.

Columns of a curve or an effect, and figures of the plant within their tolerance beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from sim2real.fitting import MAX_SIGMAS
from stagedata import F64, BoolArray

_WORTH = 3.0
"""Height of a held curve over its bends: that of a wave of ten nodes."""
_LITTLE = 1e-6
"""Weight of the penalty on every height, which keeps what was hardly passed at 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """How well something predicts blocks of samples that it was not fitted to.

    Attributes:
        energies: squared residual over floor of each block, float64[blocks].
        values: fitted to all blocks, in the order of its columns.
        sigma: of these.
        folds: fitted to all groups but each.
    """

    energies: F64
    values: F64
    sigma: F64
    folds: tuple[F64, ...]

    @property
    def energy(self) -> float:
        """Of all blocks."""
        return float(self.energies.sum())


class GroupedFit:
    """Columns with their squares.

    Args:
        both: columns, then figures, then what else is fitted beside them, then the residual,
            float64[R, n].
        group: of each sample, int64[R].
        block: of each sample, int64[R]; each belongs to one group.
        counts: of groups and of blocks, with those that have no samples.
        size: number of the columns.
        moved: sigmas that the figures behind them are off, float64[F].
        coherent: samples that count as one.
    """

    def __init__(
        self,
        both: F64,
        group: NDArray[np.int64],
        block: NDArray[np.int64],
        counts: tuple[int, int],
        size: int,
        moved: F64,
        coherent: float,
    ) -> None:
        groups, self._count = counts
        own = [group == number for number in range(groups)]
        self._parts = [both[samples] for samples in own]
        self._blocks = [block[samples] for samples in own]
        self._squares = [part.T @ part for part in self._parts]
        self._total = np.sum(self._squares, axis=0)
        self._size, self._coherent = size, coherent
        figures = slice(size, size + len(moved))
        self._plain = np.zeros((len(self._total) - 1, len(self._total) - 1))
        self._plain[figures, figures] = coherent * np.eye(len(moved))
        self._spread = np.full(size, np.inf)
        self._held = np.zeros(len(self._plain))
        self._held[figures] = coherent * moved
        self._bounds = figures, -MAX_SIGMAS - moved, MAX_SIGMAS - moved

    def hold(self, held: BoolArray, values: F64) -> None:
        """Expect of a curve that shows by its bends only no more than these are worth.

        Args:
            held: which of the columns it is, bool[n].
            values: fitted without, float64[n or more].
        """
        own = np.flatnonzero(held)
        if len(own) > 2:
            bends_rms = float(np.sqrt(np.mean(np.diff(values[own], 2) ** 2)))
            self._spread[own] = max(_WORTH * bends_rms, 1e-12)
            self._plain[own, own] = self._coherent / self._spread[own] ** 2

    def best(self, penalties: Sequence[F64]) -> F64:
        """Values fitted to all samples with the best of these penalties, as of `judged`."""
        prior, _, _ = self._chosen(penalties)
        return self._values(self._total, prior)

    def judged(self, penalties: Sequence[F64]) -> Prediction:
        """The prediction with the best of these penalties.

        Args:
            penalties: float64[n, n] per sample and squared column, each.
        """
        prior, energies, folds = self._chosen(penalties)
        samples = sum(map(len, self._parts))
        noise = self._coherent * max(float(energies.sum()) / max(samples, 1), 1.0)
        inverse = np.linalg.inv(_normal(self._total, prior))
        sigma = np.sqrt(np.maximum(noise * np.diag(inverse), 0.0))
        sigma[: self._size] = np.minimum(sigma[: self._size], self._spread)
        return Prediction(energies, self._values(self._total, prior), sigma, folds)

    def _chosen(self, penalties: Sequence[F64]) -> tuple[F64, F64, tuple[F64, ...]]:
        """The best penalty as a prior of all values, energies of the blocks, values by group."""
        own = slice(self._size)
        mean = max(float(np.trace(self._total[own, own])) / max(self._size, 1), 1e-12)
        priors = []
        for penalty in penalties:
            there = self._plain.copy()
            there[own, own] += mean * (penalty + _LITTLE * np.eye(self._size))
            priors.append(there)
        energies = np.zeros((self._count, len(priors)))
        folds = []
        for part, block, square in zip(self._parts, self._blocks, self._squares, strict=True):
            values = [self._values(self._total - square, there) for there in priors]
            folds.append(values)
            first = np.flatnonzero(np.diff(block, prepend=-1))
            if len(first):
                left = (part[:, :-1] @ np.transpose(values) + part[:, -1:]) ** 2
                energies[block[first]] = np.add.reduceat(left, first)
        best = int(energies.sum(axis=0).argmin())
        return priors[best], energies[:, best], tuple(values[best] for values in folds)

    def _values(self, squares: F64, prior: F64) -> F64:
        return _solve(squares, prior, self._held, self._bounds)


def _solve(squares: F64, prior: F64, held: F64, bounds: tuple[slice, F64, F64]) -> F64:
    """Values that minimise |columns x + residual|^2 + the prior's cost within bounds, float64[n].

    Args:
        squares: of columns and residual, float64[n + 1, n + 1].
        prior: float64[n, n].
        held: slope of the prior's cost at 0, float64[n].
        bounds: which values have a lowest and a highest one, and these.
    """
    normal, slope = _normal(squares, prior), squares[:-1, -1] + held
    own, low, high = bounds
    free = np.ones(len(slope), dtype=np.bool_)
    values = -_solve_positive(normal, slope)
    while True:
        within = np.clip(values[own], low, high)
        beyond = np.flatnonzero(within != values[own]) + own.start
        if not len(beyond):
            return values
        values[own], free[beyond] = within, False
        there = (slope + normal[:, ~free] @ values[~free])[free]
        values[free] = -_solve_positive(normal[np.ix_(free, free)], there)


def _normal(squares: F64, prior: F64) -> F64:
    """Normal equations with a ridge that hardly counts, float64[n, n]."""
    normal = squares[:-1, :-1] + prior
    normal.flat[:: len(normal) + 1] += 1e-12 * np.diag(normal) + 1e-300
    return normal


def _solve_positive(normal: F64, slope: F64) -> F64:
    """Solution of normal equations, by Cholesky unless rounding has spoiled them."""
    if not len(slope):  # all values are on their bounds
        return slope
    _, values, failed = dposv(normal.T, slope)
    return np.asarray(np.linalg.solve(normal, slope) if failed else values)


def bends(bent: int, size: int) -> F64:
    """Second differences of the first `bent` of `size` heights, float64[bent - 2, size]."""
    return np.diff(np.eye(bent, size), 2, axis=0) if bent > 2 else np.empty((0, size))
