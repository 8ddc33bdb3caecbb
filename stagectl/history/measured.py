"""What a move has shown of the level at its place, and how much that is worth.

The one place where an estimate becomes a measurement: for the tracking of the run that makes it,
and for all that read it from the history later.
"""

from __future__ import annotations

import math
from typing import Protocol

from estimation.friction import Friction

PRESLIDING_ERROR = 0.006
"""What the level of a move that hardly slid is off by beside its sigma, relative (measured)."""
PRESLIDING_MISFIT, SLIDING_MISFIT = (0.5, 0.1), (0.7, 0.06)
"""A usual misfit (`Shown.misfit`), and what the level is off by for each unit beyond it, relative
(measured): moves that hardly slid, where an element sticks a sample earlier or later than the
sampled positions tell; moves that slid, over something that the map does not know."""


JUMP = 5.0
"""Beyond so many standard deviations from what the estimator expected, the level after a move is
all the move's: taking the expectation out of it as of a normal estimate would go far beyond it."""


class Shown(Protocol):
    """What of an estimate tells the level; see `estimation.online.Estimate`."""

    @property
    def shown(self) -> tuple[float, float] | None:
        """Level and its standard deviation [N]."""

    @property
    def accepted(self) -> bool:
        """Whether it was learned from."""

    @property
    def friction(self) -> Friction:
        """The model afterwards."""

    @property
    def level(self) -> float:
        """Factor on its Coulomb force at the end of the move, 1 + w."""

    @property
    def expected(self) -> tuple[float, float]:
        """Level before the move and its standard deviation [N]."""

    @property
    def zones(self) -> str:
        """With an "A" where the axis slid."""

    @property
    def misfit(self) -> float:
        """Rms of the whitened residual."""


def measured_level(estimate: Shown) -> tuple[float, float] | None:
    """Fc (1 + w) that a move alone has shown and its standard deviation [N]; None where it did not.

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


def doubt(estimate: Shown) -> float:
    """What the level that a sliding move shows may be off by beside its sigma, relative.

    Where the model does not explain it, friction on the way may not be as it was: that is no reason
    to be less surprised, only to believe the figure less.
    """
    return _unexplained(estimate, SLIDING_MISFIT) if "A" in estimate.zones else 0.0


def _unexplained(estimate: Shown, misfit: tuple[float, float]) -> float:
    usual, error = misfit
    return error * max(estimate.misfit - usual, 0.0)
