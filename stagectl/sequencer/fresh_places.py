"""Sites that nothing is known of yet: every one is met with an open mind."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.online import Estimate
from stagectl.sequencer.places import Expectation

F64 = NDArray[np.float64]

NEAR = 5e-3
"""Moves within this distance stay at their site [m]."""
SPREAD = 0.3
"""How far the Coulomb force of another site may be from the last one's, relative, 1 sigma."""


class FreshPlaces:
    """`sequencer.places.Places` without a map: at each new place the Coulomb force is open again.

    Args:
        coulomb: axis -> Coulomb force to begin with [N], in the machine's order.
    """

    def __init__(self, coulomb: Mapping[str, float]) -> None:
        self._coulomb = list(coulomb.values())
        self._place: tuple[float, ...] | None = None

    def depart(self, target: Sequence[float], time: float) -> Sequence[Expectation] | None:
        """As `Places`."""
        if self._place is not None and math.dist(self._place, target) <= NEAR:
            return None
        self._place = tuple(target)
        return [Expectation(value, SPREAD * value) for value in self._coulomb]

    def relief(self, axis: int, path: F64) -> F64:
        """As `Places`: nothing is known of the way."""
        return np.zeros(len(path))

    def teaches(self, kind: str) -> bool:
        """As `Places`: a level that differs along a long way looks like viscous friction."""
        return kind != "macro"

    def arrived(self, axis: int, kind: str, estimate: Estimate, time: float) -> Expectation | None:
        """As `Places`: the next site is expected to be as the last one was."""
        self._coulomb[axis] = estimate.friction.coulomb * estimate.level
        return None
