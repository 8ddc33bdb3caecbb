"""Friction that differs over the table, for the move under way.

Joins `places`, which knows the Coulomb force over the table, to the compensation of each axis:
before a move every axis is given the friction expected at the target, along it the variation of
the Coulomb force, and after it `places` gets the estimate. Without `places`, or where a move stays
at its place, friction is the same everywhere and nothing here has any effect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.move import MoveData
from stagectl.sequencer.compensation import AxisCompensation, Learned
from stagectl.sequencer.places import Places

F64 = NDArray[np.float64]


class PathFriction:
    """Friction along the current move.

    Args:
        compensation: of every axis, in the order of all arrays.
        places: friction over the table; None where it is taken to be the same everywhere.

    Attributes:
        varies: whether the Coulomb force differs along the current move.
    """

    def __init__(self, compensation: Sequence[AxisCompensation], places: Places | None) -> None:
        self.varies = False
        self._compensation, self._places = tuple(compensation), places
        self._demanded: list[F64] = []
        self._measured: list[F64] = []

    def begin(self, place: Sequence[float], demand: F64, time: float) -> None:
        """Give every axis the friction expected where a move goes.

        Args:
            place: whose friction the move will meet [m].
            demand: setpoints of the move [m], shape (K, n).
            time: of the stage [s].
        """
        expected = None if self._places is None else self._places.expected_at(place, time)
        self.varies = expected is not None
        if expected is None:
            return
        for compensation, friction in zip(self._compensation, expected, strict=True):
            if friction is not None:
                compensation.expect_at_target(friction.coulomb, friction.sigma, friction.level)
        self._demanded = self._variation(demand)

    def measure(self, path: F64) -> None:
        """Note the positions of the move so far [m], shape (K, n)."""
        if self.varies:
            self._measured = self._variation(path)

    def along_demand(self, axis: int) -> F64 | None:
        """Fc at every setpoint relative to that at the target, minus 1, shape (K,), or None."""
        return self._demanded[axis] if self.varies else None

    def leveled(self, axis: int, record: MoveData) -> MoveData:
        """The record of an axis as if the Coulomb force were that of the target all the way."""
        if not self.varies:
            return record
        return self._compensation[axis].level_with_target(record, self._measured[axis])

    def is_known(self, kind: str) -> bool:
        """Whether friction along a move of this kind is known well enough to learn from it."""
        return self._places is None or self._places.knows_path(kind)

    def carry_state(self, axis: int, record: MoveData) -> None:
        """Carry the friction state of an axis through the move."""
        if self.varies:
            self._compensation[axis].carry_state(record, self._measured[axis])

    def report(self, axis: int, kind: str, learned: Learned, time: float) -> None:
        """Report an estimate to `places`, and adopt what they now know of this place."""
        if self._places is None:
            return
        friction = self._places.learn(axis, kind, learned.estimate, time)
        if friction is not None:
            self._compensation[axis].correct_at_place(
                friction.coulomb, friction.sigma, friction.level
            )

    def _variation(self, path: F64) -> list[F64]:
        assert self._places is not None  # noqa: S101  it varies, so they are known
        return [self._places.coulomb_variation(a, path) for a in range(len(self._compensation))]
