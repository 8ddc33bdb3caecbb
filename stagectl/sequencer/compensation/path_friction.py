"""What differs along the move under way: friction over the table, and known effects.

Joins `places`, which knows the Coulomb force over the table, to the compensation of each axis:
before a move every axis is given the friction expected at the target, along it the variation of
the Coulomb force, and after it `places` gets the estimate. What the machine file's effects do
(`known_axis`) is predicted before a move, and taken from its record before anything is learned from
it. Without either, or where a move stays at its place, nothing here has any effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.move import MoveData
from estimation.trajectory import Trajectory
from stagectl.sequencer.compensation.axis_compensation import AxisCompensation, AxisMotion, Learned
from stagectl.sequencer.compensation.places import Places
from stagedata import F64


class PathFriction:
    """Friction and known effects along the current move.

    Args:
        compensation: of every axis, in the order of all arrays.
        places: friction over the table; None where it is taken to be the same everywhere.
        period: Ts [s].

    Attributes:
        varies: whether `places` say that the Coulomb force differs along the current move.
    """

    def __init__(
        self, compensation: Sequence[AxisCompensation], places: Places | None, period: float
    ) -> None:
        self.varies = False
        self._compensation, self._places, self._period = tuple(compensation), places, period
        self._path: F64 = np.zeros((0, len(self._compensation)))
        self._measured: list[F64 | None] = []

    def begin(
        self, place: Sequence[float], motion: Sequence[Trajectory], demand: F64, time: float
    ) -> list[AxisMotion]:
        """Give every axis the friction expected where a move goes, and predict known effects.

        Args:
            place: whose friction the move will meet [m].
            motion: demand of every axis.
            demand: setpoints of the move [m], shape (K, n).
            time: of the stage [s].

        Returns:
            The demand of each axis, with the variation of its Coulomb force.
        """
        expected = None if self._places is None else self._places.expected_at(place, time)
        self.varies = expected is not None
        for compensation, friction in zip(self._compensation, expected or (), strict=False):
            if friction is not None:
                compensation.expect_at_target(friction)
        across = motion[::-1] if len(motion) == 2 else [None] * len(motion)
        demanded = [AxisMotion(*both, len(demand)) for both in zip(motion, across, strict=True)]
        for compensation, own in zip(self._compensation, demanded, strict=True):
            if compensation.known is not None:
                compensation.begin_known(own, demand, time)
        varied = zip(demanded, self._variation(demand, time), strict=True)
        return [replace(own, variation=variation) for own, variation in varied]

    def measure(self, records: Sequence[MoveData], path: F64) -> list[MoveData]:
        """Note the positions of the move so far [m], shape (M, n).

        Returns:
            The records without what is known beside mass and friction.
        """
        self._path = path
        self._measured = self._variation(path, records[0].time)
        bare = list(records)
        for a, compensation in enumerate(self._compensation):
            if compensation.known is not None:
                seen = records[1 - a].valid if len(records) == 2 else records[a].valid
                bare[a] = compensation.known.without(records[a], path, seen)
        return bare

    def leveled(self, axis: int, record: MoveData) -> MoveData:
        """The record of an axis as if the Coulomb force were that of the target all the way."""
        variation = self._measured[axis]
        if variation is None:
            return record
        return self._compensation[axis].level_with_target(record, variation)

    def is_known(self, kind: str) -> bool:
        """Whether friction along a move of this kind is known well enough to learn from it."""
        return self._places is None or self._places.knows_path(kind)

    def carry_state(self, axis: int, record: MoveData) -> None:
        """Carry the state of an axis through the move, where it differs along it."""
        compensation, variation = self._compensation[axis], self._measured[axis]
        if variation is not None:
            compensation.carry_state(record, variation)
        if compensation.known is not None:
            compensation.known.carry(self._path)

    def hold_offsets(self, offset: F64, count: int) -> F64:
        """Force offsets of the next setpoints at rest [N], shape (count, n).

        Args:
            offset: in force now [N], shape (n,).
            count: how many.
        """
        offsets = np.tile(offset, (count, 1))
        for a, compensation in enumerate(self._compensation):
            if compensation.known is not None:
                offsets[:, a] += compensation.known.hold(count)
        return offsets

    def held(self, offset: F64, offsets: F64, done: int) -> F64:
        """Force offset in force [N], shape (n,), after `done` setpoints of `hold_offsets`."""
        for compensation in self._compensation:
            if compensation.known is not None:
                compensation.known.held(done)
        return offsets[done - 1].copy() if done else offset

    def report(self, axis: int, kind: str, learned: Learned, time: float) -> None:
        """Report an estimate to `places`, and adopt what they now know of this place."""
        if self._places is None:
            return
        friction = self._places.learn(axis, kind, learned.estimate, time)
        if friction is not None:
            self._compensation[axis].correct_at_place(friction)

    def _variation(self, path: F64, time: float) -> list[F64 | None]:
        """Fc of each axis relative to that at the target, minus 1; None where it is the same."""
        moments = np.asarray(time + np.arange(len(path)) * self._period, np.float64)
        found: list[F64 | None] = []
        for a, compensation in enumerate(self._compensation):
            variation = None
            if self.varies and self._places is not None:
                variation = self._places.coulomb_variation(a, path)
            if compensation.known is not None:
                variation = compensation.known.variation(variation, path, moments)
            found.append(variation)
        return found
