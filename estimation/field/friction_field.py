"""A friction figure over the table, with its uncertainty, from scattered sites: a Gaussian process.

The logarithm of the figure is a constant plus a stationary random field plus what each site's
estimate is off by. Nobody knows the field's kernel, its correlation length and amplitude; with a
few dozen sites a maximum-likelihood fit of them is luck, and overconfident. So they are averaged
over: every combination of a grid is weighted by its marginal likelihood times a broad prior, and
the prediction is the mixture (C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine
Learning, 2006, chapters 2 and 5; the constant is integrated out with a flat prior, section 2.7).

The map ends half a site spacing outside the sites' convex hull. Beyond, the value at the edge
stands, with the uncertainty of the distance, and `Prediction.inside` says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.field.convex_hull import Hull
from stagedata import F64

Kernel = Callable[[F64], F64]

MOST_NODES = 40
"""Combinations of hyperparameters kept, of the grid's; the others have next to no weight."""
_JITTER = 1e-10


def _gaussian(r: F64) -> F64:
    result: F64 = np.exp(-0.5 * r * r)
    return result


def _matern52(r: F64) -> F64:
    z = math.sqrt(5.0) * r
    result: F64 = (1.0 + z + z * z / 3.0) * np.exp(-z)
    return result


def _matern32(r: F64) -> F64:
    z = math.sqrt(3.0) * r
    result: F64 = (1.0 + z) * np.exp(-z)
    return result


KERNELS: dict[str, tuple[Kernel, float]] = {
    "gaussian": (_gaussian, 0.5),
    "matern 5/2": (_matern52, 0.35),
    "matern 3/2": (_matern32, 0.15),
}
"""Correlation over distance / length, and prior weight: smooth fields come first."""


# Prior of the field, for any table.
_LENGTH, _LENGTH_SPREAD = 0.45, 0.6
"""Correlation length, relative to the extent of the sites: median, and standard deviation of its
logarithm."""
_AMPLITUDE, _AMPLITUDE_SPREAD = 0.1, 0.9
"""Rms of the field, relative: likewise."""
_SCATTER = ((0.0, 0.85), (0.01, 0.15))
"""Rms by which sites differ from a smooth field beside their own uncertainty: values tried, with
their prior weights."""
_GRID = 11, 9
"""Values of length and of amplitude tried."""


@dataclass(frozen=True, slots=True)
class Node:
    """One combination of hyperparameters.

    Attributes:
        weight: of all nodes they add up to 1.
        kernel: of `KERNELS`.  length: [m].  amplitude: rms of the logarithm.
        scatter: rms of the logarithm.
    """

    weight: float
    kernel: str
    length: float
    amplitude: float
    scatter: float


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The figure at m places.

    Attributes:
        value: [unit of the figure], shape (m,).
        sigma: standard deviation, relative to the value, shape (m,).
        inside: whether the place is on the map, shape (m,); elsewhere its edge's value stands.
    """

    value: F64
    sigma: F64
    inside: NDArray[np.bool_]

    def band(self) -> tuple[F64, F64]:
        """Lowest and highest value with a probability of 95 %: 1.96 standard deviations."""
        spread = np.exp(1.96 * self.sigma)
        return self.value / spread, self.value * spread


class FrictionField:
    """A figure over the table.

    Args:
        places: of the sites [m], shape (n, 2), n >= 1; the same place may come more than once.
        values: of the figure there, > 0, shape (n,).
        sigma: relative standard deviation of each, shape (n,).
        nodes: hyperparameters found before; None fits them.

    Attributes:
        nodes: hyperparameters with their weights.
        hull: of the sites.
        edge: how far outside the hull the map reaches [m].

    Raises:
        ValueError: shapes that do not agree, or values that cannot be.
    """

    def __init__(
        self,
        places: F64,
        values: F64,
        sigma: F64,
        nodes: Sequence[Node] | None = None,
    ) -> None:
        self.places = np.array(places, dtype=np.float64)
        self.values = np.array(values, dtype=np.float64)
        self.sigma = np.array(sigma, dtype=np.float64)
        count = len(self.values)
        if count < 1 or self.places.shape != (count, 2) or self.sigma.shape != (count,):
            raise ValueError("places, values and sigma of one or more sites are needed")
        if not (np.isfinite(self.places).all() and np.isfinite(self.sigma).all()):
            raise ValueError("places and sigma must be finite")
        if not (np.isfinite(self.values).all() and (self.values > 0).all()):
            raise ValueError("values must be > 0")
        self._log = np.log(self.values)
        self.hull = Hull.of(self.places)
        self._distance = _distances(self.places, self.places)
        self.edge = 0.5 * _spacing(self._distance)
        self.nodes = self._fitted() if nodes is None else tuple(nodes)
        self._solved = [self._solve(node) for node in self.nodes]

    @property
    def length(self) -> float:
        """Correlation length, mean over the nodes' logarithms [m]."""
        return math.exp(sum(node.weight * math.log(node.length) for node in self.nodes))

    @property
    def amplitude(self) -> float:
        """Rms of the field, mean over the nodes."""
        return sum(node.weight * node.amplitude for node in self.nodes)

    def at(self, places: F64) -> Prediction:
        """The figure of a smooth table at these places [m], shape (m, 2).

        What a single site differs by (`Node.scatter`) is in sigma, for it is there at any place.
        """
        wanted = np.atleast_2d(np.asarray(places, dtype=np.float64))
        nearest, outside = self.hull.clamp(wanted, self.edge)
        mean, covariance = self._mixture(nearest, None)
        variance = covariance + self._growth(outside)
        return Prediction(np.exp(mean), np.sqrt(variance), outside <= 0.0)

    def value(self, places: F64) -> F64:
        """The mean alone at these places [m], shapes (m, 2) and (m,); fast for many places."""
        nearest, _ = self.hull.clamp(np.atleast_2d(np.asarray(places, np.float64)), self.edge)
        distance = _distances(nearest, self.places)
        mean = np.zeros(len(nearest))
        for node, (_, weights, ones, total) in zip(self.nodes, self._solved, strict=True):
            cross = node.amplitude**2 * KERNELS[node.kernel][0](distance / node.length)
            mean += node.weight * (float(ones @ self._log) / total + cross @ weights)
        return np.asarray(np.exp(mean), np.float64)

    def joint(self, places: F64) -> tuple[F64, F64]:
        """Logarithm of the figure at these places and its covariance, shapes (m,) and (m, m).

        For who continues to learn: sites are correlated, one says something of its neighbours.
        """
        wanted = np.atleast_2d(np.asarray(places, dtype=np.float64))
        nearest, outside = self.hull.clamp(wanted, self.edge)
        mean, covariance = self._mixture(nearest, _distances(nearest, nearest))
        covariance[np.diag_indices(len(wanted))] += self._growth(outside)
        return mean, covariance

    def left_out(self) -> tuple[F64, F64]:
        """Each site predicted from the others: logarithm of the ratio true to predicted, sigma.

        Sundararajan and Keerthi's closed form; what a map is judged by before it is used.
        """
        n = len(self._log)
        mean, second = np.zeros(n), np.zeros(n)
        if n < 3:
            return mean, np.full(n, math.inf)
        for node, (factor, weights, ones, total) in zip(self.nodes, self._solved, strict=True):
            inverse = _inverse(factor)
            projected = inverse - np.outer(ones, ones) / total
            diagonal = projected.diagonal()
            error = weights / diagonal
            mean += node.weight * error
            second += node.weight * (1.0 / diagonal + error**2)
        return mean, np.sqrt(np.maximum(second - mean**2, 0.0))

    def _growth(self, outside: F64) -> F64:
        """Variance that comes with the distance from the edge [m], shape as given."""
        total = np.zeros(len(outside))
        for node in self.nodes:
            correlation = KERNELS[node.kernel][0](np.maximum(outside, 0.0) / node.length)
            total += node.weight * 2.0 * node.amplitude**2 * (1.0 - correlation)
        return total

    def _mixture(self, places: F64, between: F64 | None) -> tuple[F64, F64]:
        """Mean and (co)variance of the mixture; `between`: distances, None for variances only."""
        distance = _distances(places, self.places)
        means, parts = [], []
        for node, (factor, weights, ones, total) in zip(self.nodes, self._solved, strict=True):
            kernel = KERNELS[node.kernel][0]
            cross = node.amplitude**2 * kernel(distance / node.length)
            constant = float(ones @ self._log) / total
            means.append(constant + cross @ weights)
            half = np.linalg.solve(factor, cross.T)
            away = 1.0 - cross @ ones
            if between is None:
                variance = node.amplitude**2 - np.einsum("ij,ij->j", half, half)
                variance = variance + away**2 / total + node.scatter**2
                parts.append(np.maximum(variance, 1e-12))
            else:
                joint = node.amplitude**2 * kernel(between / node.length) - half.T @ half
                joint = joint + np.outer(away, away) / total
                joint[np.diag_indices(len(places))] += node.scatter**2 + 1e-12
                parts.append(joint)
        weight = np.array([node.weight for node in self.nodes])
        stacked = np.array(means)
        mean = weight @ stacked
        off = stacked - mean
        spread = (
            np.einsum("k,ki,ki->i", weight, off, off)
            if between is None
            else np.einsum("k,ki,kj->ij", weight, off, off)
        )
        return mean, np.tensordot(weight, np.array(parts), 1) + spread

    def _solve(self, node: Node) -> tuple[F64, F64, F64, float]:
        """Cholesky factor L, K^-1 (y - constant), K^-1 1, and 1' K^-1 1 (plus its prior)."""
        kernel = KERNELS[node.kernel][0]
        matrix = node.amplitude**2 * kernel(self._distance / node.length)
        matrix[np.diag_indices(len(matrix))] += self.sigma**2 + node.scatter**2 + _JITTER
        factor: F64 = np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
        sides = np.column_stack([self._log, np.ones(len(self._log))])
        solved: F64 = np.asarray(
            np.linalg.solve(factor.T, np.linalg.solve(factor, sides)), dtype=np.float64
        )
        total = float(solved[:, 1].sum())
        constant = float(solved[:, 0].sum()) / total
        return factor, solved[:, 0] - constant * solved[:, 1], solved[:, 1], total

    def _fitted(self) -> tuple[Node, ...]:
        extent = float(np.ptp(self.places, axis=0).max()) or 0.1
        lengths = _around(_LENGTH * extent, _LENGTH_SPREAD, _GRID[0])
        amplitudes = _around(_AMPLITUDE, _AMPLITUDE_SPREAD, _GRID[1])
        found: list[tuple[float, Node]] = []
        for name, (_, kernel_weight) in KERNELS.items():
            for length, length_weight in lengths:
                for amplitude, amplitude_weight in amplitudes:
                    for scatter, scatter_weight in _SCATTER:
                        node = Node(1.0, name, length, amplitude, scatter)
                        weight = kernel_weight * length_weight * amplitude_weight * scatter_weight
                        found.append((self._evidence(node) + math.log(weight), node))
        best = max(score for score, _ in found)
        found.sort(key=lambda entry: -entry[0])
        kept = [(math.exp(score - best), node) for score, node in found[:MOST_NODES]]
        total = sum(weight for weight, _ in kept)
        return tuple(
            Node(weight / total, node.kernel, node.length, node.amplitude, node.scatter)
            for weight, node in kept
        )

    def _evidence(self, node: Node) -> float:
        """Logarithm of the marginal likelihood, the constant integrated out."""
        factor, weights, _, total = self._solve(node)
        determinant = 2.0 * float(np.log(factor.diagonal()).sum())
        return -0.5 * (float(self._log @ weights) + determinant + math.log(total))


def _around(median: float, spread: float, count: int) -> list[tuple[float, float]]:
    """Values of a log-normal prior on an even grid of its logarithm, with their weights."""
    steps = np.linspace(-2.2, 2.2, count)
    return [(median * math.exp(spread * s), math.exp(-0.5 * s * s)) for s in steps.tolist()]


def _distances(a: F64, b: F64) -> F64:
    difference = a[:, None, :] - b[None, :, :]
    result: F64 = np.sqrt(np.einsum("ijk,ijk->ij", difference, difference))
    return result


def _spacing(distance: F64) -> float:
    """Median distance from a site to its nearest other one [m]; 0 where there is none."""
    apart = np.where(distance > 1e-9, distance, np.inf).min(axis=1)
    apart = apart[np.isfinite(apart)]
    return float(np.median(apart)) if len(apart) else 0.0


def _inverse(factor: F64) -> F64:
    half = np.linalg.solve(factor, np.eye(len(factor)))
    result: F64 = half.T @ half
    return result
