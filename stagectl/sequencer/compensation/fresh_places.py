"""Friction over the table without a map: at every new place the Coulomb force is open again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.online import Estimate
from stagectl.sequencer.compensation.places import Expectation

F64 = NDArray[np.float64]

SAME_PLACE = 5e-3
"""Moves within this distance stay at their place [m]."""
SPREAD = 0.3
"""Relative standard deviation of the Coulomb force from one place to the next."""


class FreshPlaces:
    """`compensation.places.Places` that expects of each place what the last one has shown.

    Args:
        coulomb: axis -> Coulomb force to begin with [N], in the machine's order.
    """

    def __init__(self, coulomb: Mapping[str, float]) -> None:
        self._coulomb = list(coulomb.values())
        self._place: tuple[float, ...] | None = None

    def expected_at(self, target: Sequence[float], time: float) -> Sequence[Expectation] | None:
        """As `Places`: the Coulomb force of the last place, with a wide spread."""
        if self._place is not None and math.dist(self._place, target) <= SAME_PLACE:
            return None
        self._place = tuple(target)
        return [Expectation(value, SPREAD * value) for value in self._coulomb]

    def coulomb_variation(self, axis: int, path: F64) -> F64:
        """As `Places`: unknown, so none."""
        return np.zeros(len(path))

    def knows_path(self, kind: str) -> bool:
        """As `Places`: over a long path, unknown variation would be taken for viscous friction."""
        return kind != "macro"

    def learn(self, axis: int, kind: str, estimate: Estimate, time: float) -> Expectation | None:
        """As `Places`: the next place is expected to be like this one."""
        self._coulomb[axis] = estimate.friction.coulomb * estimate.level
        return None
