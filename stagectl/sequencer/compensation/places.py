"""The sequencer's port to friction over the table: what to expect at a place, and along a path.

`maps.TrackedPlaces` answers from a friction map, `FreshPlaces` without one: at every new place the
Coulomb force is open again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from estimation.online import Estimate
from stagedata import F64

SAME_PLACE = 5e-3
"""Moves within this distance stay at their place [m]."""
SPREAD = 0.3
"""Relative standard deviation of the Coulomb force from one place to the next."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """The Coulomb force of one axis at a place.

    Attributes:
        coulomb: Fc there [N].
        sigma: its standard deviation [N].
        level: the current wander w of Fc and its standard deviation; None: unknown.
    """

    coulomb: float
    sigma: float
    level: tuple[float, float] | None = None


class Places(Protocol):
    """Knows the Coulomb force of every axis over the table, and learns it from moves.

    Axes are numbered in the machine's order; positions are those of all axes.
    """

    def expected_at(
        self, target: Sequence[float], time: float
    ) -> Sequence[Expectation | None] | None:
        """Before a move: the friction expected at its target, axis by axis.

        Args:
            target: of the move [m].
            time: of the stage [s].

        Returns:
            None where the move stays at its place; an entry is None for an axis of which nothing
            is known.
        """

    def coulomb_variation(self, axis: int, path: F64) -> F64:
        """Fc along a path relative to that at the last target asked for, minus 1, shape (K,).

        Args:
            axis: its number.
            path: positions [m], shape (K, n).
        """

    def knows_path(self, kind: str) -> bool:
        """Whether friction along moves of this kind is known, so that they can be learned from."""

    def learn(self, axis: int, kind: str, estimate: Estimate, time: float) -> Expectation | None:
        """After a move: learn from its estimate.

        Args:
            axis: its number.
            kind: of the move.
            estimate: what the estimator made of it.
            time: of the stage [s].

        Returns:
            What is now known of the place, where that should replace what the axis believes.
        """


class FreshPlaces:
    """`Places` that expects of each place what the last one has shown.

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
