"""The compiled call of one update, on arrays that are kept for the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.friction.gms import F64, Friction, FrictionState, element_shares
from estimation.move import MoveData
from estimation.online.belief import RATE, STIFFNESS, Belief
from estimation.online.move_tables import floats_for, marks_for
from estimation.online.settings import EstimatorSettings
from estimation.online.update import UNEQUAL, update_move
from estimation.online.update_tables import AXIS, BELIEFS, C_TYPICAL, CONSTANTS, UPDATE_SIZE

_LEAST_ROOM, _MANY_ELEMENTS = 512, 16
_rooms: list[_Room] = []
"""Not in use; for all axes, as nothing in them outlives an update."""


_NONE = np.zeros(0, np.bool_)


class _Room:
    """Arrays for a move of so many samples or fewer."""

    __slots__ = ("elements", "floats", "marks", "samples")

    def __init__(self, samples: int, elements: int) -> None:
        self.samples, self.elements = samples, elements
        self.floats: F64 = np.empty(BELIEFS + floats_for(samples, elements))
        self.marks: NDArray[np.int8] = np.empty(marks_for(samples), np.int8)


def _room_for(samples: int, elements: int) -> _Room:
    """One that nobody uses; whoever is done with it puts it back."""
    room = _rooms.pop() if _rooms else None
    if room is None or room.samples < samples or room.elements < elements:
        room = _Room(max(samples, _LEAST_ROOM), max(elements, _MANY_ELEMENTS))
    return room


class MoveSolver:
    """Solves the moves of one axis.

    Args:
        friction: model that the figures are relative to.
        settings: of the estimation.
        frozen: keep the friction figures.

    Raises:
        ValueError: settings that name a figure that there is not.
    """

    def __init__(self, friction: Friction, settings: EstimatorSettings, frozen: bool) -> None:
        # What the kernel takes, made once.
        units, shares = settings.units(friction), element_shares(friction.elements)
        self._axis = np.concatenate([settings.constants(friction), units.ravel(), shares])
        self.units = self._axis[CONSTANTS:AXIS].reshape(units.shape)
        usual = settings.masks(frozen)
        self._masks = np.stack([usual, usual, usual])
        self._masks[1, :, RATE] = False  # moves that do not go far
        self._masks[2, :, STIFFNESS] = False  # those that settle at once
        self._elements = friction.elements

    def expect(self, misfit: float) -> None:
        """The misfit that this axis' moves usually have; until the first call anything is usual."""
        self._axis[C_TYPICAL] = misfit

    def saturates_at(self, force: float) -> None:
        """From now on samples at or beyond this force are saturated [N]."""
        self._axis[C_PEAK] = force

    def solve(
        self,
        move: MoveData,
        rest: float,
        elapsed: float,
        restless: float,
        belief: Belief,
        state: FrictionState,
        known: bool,
        whole: bool,
    ) -> tuple[F64, int, float, float]:
        """Learn from a move and carry the friction state to its end.

        Args:
            move: as sampled.
            rest: position before it [m]; nan: not known.
            elapsed: since the end of the last move [s]; negative: there was none.
            restless: variance by which Coulomb force ages beside its drift, relative.
            belief: after the last move; updated.
            state: at rest before the move; carried to its end.
            known: whether that is more than the sum of the element forces.
            whole: False for a move that is not over: zone A only, belief stays.

        Returns:
            What it left, see `update_tables`; and what `update_move` returns.

        Raises:
            ValueError: shapes that differ, or fewer than three valid samples.
        """
        upset = _NONE if move.upset is None else move.upset
        room = _room_for(len(move.position), self._elements)
        result = np.empty(UPDATE_SIZE)
        verdict, misfit, doubt = update_move(
            move.position, move.force, move.valid, upset, rest, move.rest_force, elapsed, restless,
            known, whole, self._axis, self._masks, belief.mean, belief.covariance, state.forces,
            state.slipping, state.memory, room.floats, room.marks, result,
        )  # fmt: skip
        _rooms.append(room)
        if verdict < 0:
            raise ValueError(
                "position, force and valid must have the same length"
                if verdict == UNEQUAL
                else "fewer than three valid samples"
            )
        return result, verdict, misfit, doubt
