"""The known factor on the Coulomb force along a path."""

from __future__ import annotations

import numpy as np

from estimation.known_effects.terms import F64, KnownTerms
from stagedata.compiled import kernel

TURN_BAND = 4e-9
"""A way back of this much is another direction: a few times the encoder noise [m]."""
_LEAST = 1e-3
"""Friction laws have some Coulomb force."""


def coulomb_factor(
    terms: KnownTerms, own: F64, other: F64, time: F64, heading: F64 | None = None
) -> F64:
    """Factor on Fc along a path, shape (K,).

    Args:
        terms: of the axis.
        own: its positions [m], shape (K,).
        other: those of the other axis [m], shape (K,).
        time: since the first SYNC [s], shape (K,).
        heading: direction of motion, of `directions`, shape (K,); where it is 0, and where None,
            the mean of both directions counts.
    """
    mean, half = 0.5 * (terms.forward + terms.backward), 0.5 * (terms.forward - terms.backward)
    factor = np.full(len(own), mean) if heading is None else mean + half * heading
    for surface in terms.table_factors:
        factor = factor * surface(own, other)
    for curve in terms.time_factors:
        factor = factor * curve(time)
    return np.asarray(np.maximum(factor, _LEAST))


def directions(position: F64) -> F64:
    """Direction of motion at each sample, +1 or -1, 0 before any; `position` [m], shape (K,)."""
    heading = np.empty(len(position))
    _mark_directions(np.ascontiguousarray(position), TURN_BAND, heading)
    return heading


@kernel()
def _mark_directions(position, band, heading):  # type: ignore[no-untyped-def]
    """Write the direction at each sample; it turns once the way back exceeds `band` [m]."""
    direction, extreme = 0.0, position[0]
    for k in range(position.shape[0]):
        away = position[k] - extreme
        if away * direction > 0.0:
            extreme = position[k]
        elif abs(away) > band:
            direction, extreme = (1.0 if away > 0.0 else -1.0), position[k]
        heading[k] = direction
