"""How much faster the Coulomb force changes than believed, from surprises that go one way.

A stage that warms up changes by a per cent and more from move to move; with the usual drift in
the arrival cost the estimate would lag behind by several. Wander surprises too, but to and fro:
the mean of the surprises, forgotten from move to move, stays small. Where it does not, its square
is what the Coulomb force's process noise lacks.
"""

from __future__ import annotations

from dataclasses import dataclass

_SHARE = 0.35
"""Of a new surprise in their mean."""
_NOTICE = 2.5
"""The mean counts from so many of its own standard deviations, were all surprises independent."""
_MOST = 0.1
"""A surprise is not counted for more: a jump is not drift."""


@dataclass(slots=True)
class Restlessness:
    """Of one axis; everything relative to the level.

    Attributes:
        variance: by which belief in the Coulomb force ages from move to move beside its drift.
    """

    variance: float = 0.0
    _mean: float = 0.0
    _spread: float = 0.0  # variance of the mean, were the surprises independent

    def saw(self, surprise: float, variance: float) -> None:
        """Take in what a move showed of the level.

        Args:
            surprise: level shown over that expected, minus 1.
            variance: of the surprise, as believed without any restlessness.
        """
        surprise = min(max(surprise, -_MOST), _MOST)
        self._mean += _SHARE * (surprise - self._mean)
        self._spread = (1.0 - _SHARE) ** 2 * self._spread + _SHARE**2 * variance
        noticed = self._mean**2 > _NOTICE**2 * self._spread
        self.variance = self._mean**2 - self._spread if noticed else 0.0

    def calm(self) -> None:
        """Forget: what comes is another place, or its level is known from elsewhere."""
        self.variance = self._mean = self._spread = 0.0
