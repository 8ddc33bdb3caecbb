"""Known factors: on the Coulomb force along a path, and between measured force and carriage.

Force on the carriage: G(x) S tanh(gain F / S), F measured; and back.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.known_effects.terms import KnownTerms
from stagedata import F64
from stagedata.compiled import kernel

_BENT = 0.99
"""Share of the saturation force beyond which the curve is not followed any further."""
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


def delivered_force(terms: KnownTerms, measured: F64, position: F64) -> F64:
    """Force on the carriage [N] of a measured force [N] at a position [m]; shapes broadcast."""
    force = terms.gain * np.asarray(measured, np.float64)
    if math.isfinite(terms.saturation):
        force = terms.saturation * np.tanh(force / terms.saturation)
    for curve in terms.gains:
        force = force * curve(np.asarray(position, np.float64))
    return np.asarray(force)


def force_to_demand(terms: KnownTerms, force: F64, position: F64) -> F64:
    """Measured force [N] that puts `force` [N] on the carriage at `position` [m].

    As near as it gets, where the motor saturates.
    """
    demand = np.asarray(force, np.float64)
    for curve in terms.gains:
        demand = demand / curve(np.asarray(position, np.float64))
    if math.isfinite(terms.saturation):
        demand = terms.saturation * np.arctanh(np.clip(demand / terms.saturation, -_BENT, _BENT))
    return np.asarray(demand / terms.gain)
