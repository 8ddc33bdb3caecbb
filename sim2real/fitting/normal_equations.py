"""Normal equations whose columns are difference quotients of simulations with stick-slip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim2real.fitting.axis_model import NUISANCES
from stagedata import F64

_CANCELLED = 5e-2
"""Eigenvalue of J'J, with the blocks of J orthonormal, below which a direction is dropped: columns
cancel there, and what is left is mostly the error of the difference quotients."""
_BLOCK = 250
"""Samples over which the residual of a model may be correlated."""


def information_matrix(jacobian: F64, gradient: F64, blocks: Sequence[int]) -> tuple[F64, F64]:
    """J'J and gradient without the directions in which blocks of columns cancel one another.

    Difference quotients over slipping elements are not exact: what is left where large columns
    cancel is their error, not information. Within an effect's own block nothing is dropped.

    Args:
        jacobian: weighted, float64[R, P].
        gradient: float64[P].
        blocks: number of columns of each effect, after the nuisance parameters.
    """
    count = jacobian.shape[1]
    back = np.zeros((count, count))
    for j in range(NUISANCES):
        size = np.linalg.norm(jacobian[:, j])
        back[j, j] = 1.0 / size if size > 1e-100 else 0.0  # the data say nothing of it
    at = NUISANCES
    for width in blocks:
        own = slice(at, at + width)
        back[own, own] = np.linalg.pinv(np.linalg.qr(jacobian[:, own], mode="r"), rcond=1e-9)
        at += width
    scaled = jacobian @ back
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    kept = values > _CANCELLED
    vectors, values = vectors[:, kept], values[kept]
    forth = np.linalg.pinv(back, rcond=1e-15)
    normal = forth.T @ ((vectors * values) @ vectors.T) @ forth
    return normal, forth.T @ (vectors @ (vectors.T @ (back.T @ gradient)))


def solve_scaled(normal: F64, gradient: F64) -> F64:
    """Solution of the normal equations, whatever the columns' units."""
    scale = _scale(normal)
    scaled = normal / np.outer(scale, scale) + 1e-10 * np.eye(len(scale))
    return np.asarray(np.linalg.solve(scaled, gradient / scale) / scale)


def _scale(normal: F64) -> F64:
    """Size of each column; 1 where a parameter changes nothing."""
    size = np.sqrt(np.diag(normal))
    return np.asarray(np.where(size > 1e-100, size, 1.0))


def sandwich_covariance(covariance: F64, scores: F64) -> F64:
    """Covariance by the model's noise and by what is left beyond noise.

    The second part is the sandwich estimate over blocks of samples (Huber 1967, White 1982): what a
    slightly wrong model leaves is correlated over a while.
    """
    count = len(scores) // _BLOCK
    blocks = scores[: count * _BLOCK].reshape(count, _BLOCK, -1).sum(axis=1)
    return np.asarray(covariance + covariance @ (blocks.T @ blocks) @ covariance)


def invert_scaled(normal: F64) -> F64:
    """Covariance by the model's noise, whatever the columns' units.

    Args:
        normal: normal matrix of the weighted residual and the prior, float64[P, P].
    """
    scale = _scale(normal)
    scaled = normal / np.outer(scale, scale) + 1e-10 * np.eye(len(scale))
    return np.asarray(np.linalg.inv(scaled) / np.outer(scale, scale))
