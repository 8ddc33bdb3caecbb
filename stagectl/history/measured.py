"""From an estimate to a measurement: the friction level that a move has shown at its place.

Used by the tracking of the run that makes the estimate, and by the history for all later readers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from estimation.online import Estimate

PRESLIDING_ERROR = 0.006
"""Relative error, besides its sigma, of the level of a move that hardly slid (measured)."""
PRESLIDING_MISFIT, SLIDING_MISFIT = (0.5, 0.1), (0.7, 0.06)
"""Usual misfit, and relative error of the level per unit of misfit beyond it (measured).
Presliding: an element sticks a sample earlier or later than the sampled positions show. Sliding:
the move passed over something that the map does not know."""
JUMP = 5.0
"""Standard deviations from the expected level beyond which the estimate itself is the measurement:
removing the expectation from it, as from a normal estimate, would overshoot."""


def measured_level(estimate: Estimate) -> tuple[float, float] | None:
    """Fc (1 + w) that a move alone has shown and its standard deviation [N]; None without one.

    Args:
        estimate: of the move.
    """
    if "A" in estimate.zones and estimate.accepted:
        expected, sigma = estimate.expected
        value = estimate.friction.coulomb * estimate.level
        if abs(value - expected) > JUMP * sigma:
            return value, sigma
    if estimate.shown is None:
        return None
    value, sigma = estimate.shown
    if "A" in estimate.zones:
        return value, sigma
    unexplained = _unexplained(estimate, PRESLIDING_MISFIT)
    return value, math.hypot(sigma, PRESLIDING_ERROR * value, unexplained * value)


def misfit_error(estimate: Estimate) -> float:
    """Relative error, besides its sigma, of the level of a sliding move with a large misfit.

    Where the model does not explain a move, its figure deserves less trust; a step is no less
    likely for that, so this must not enter the test for steps.
    """
    return _unexplained(estimate, SLIDING_MISFIT) if "A" in estimate.zones else 0.0


def _unexplained(estimate: Estimate, misfit: tuple[float, float]) -> float:
    usual, error = misfit
    return error * max(estimate.misfit - usual, 0.0)
