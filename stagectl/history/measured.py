"""What a move has shown of the level at its place, and how much that is worth.

The one place where an estimate becomes a measurement: for the tracking of the run that makes it,
and for all that read it from the history later.
"""

from __future__ import annotations

import math

from estimation.split_horizon import Estimate

PRESLIDING_ERROR = 0.012
"""What the level of a move that hardly slid is off by beside its sigma, relative (measured)."""


def measured_level(estimate: Estimate) -> tuple[float, float] | None:
    """Fc (1 + w) that a move alone has shown and its standard deviation [N]; None where it did not.

    Args:
        estimate: of the move.
    """
    if estimate.shown is None:
        return None
    value, sigma = estimate.shown
    if "A" not in estimate.zones:
        sigma = math.hypot(sigma, PRESLIDING_ERROR * value)
    return value, sigma
