"""Between the force that a drive measures and the force on the carriage.

Force on the carriage: G(x) S tanh(gain F / S), F measured; and back.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.known_effects.terms import F64, KnownTerms

_BENT = 0.99
"""Share of the saturation force beyond which the curve is not followed any further."""


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
