"""The compiled calls of one update, one after the other, on arrays that are kept for the next.

One call for all would be compiled together with all that it carries, a second time (see `update`).
"""

from __future__ import annotations

import math

import numpy as np

from estimation.belief import COULOMB, LEVEL, MASS, RATE, STIFFNESS, Belief
from estimation.elements import ELEMENT_ROWS, FORCE, SHARES, SLIPS
from estimation.gms import F64, Friction, FrictionState, element_shares
from estimation.move_tables import KNOTS, TABLES
from estimation.rows import lead
from estimation.settings import EstimatorSettings, MoveData
from estimation.update import F_DRIFT, MOSTLY, UPDATE_SIZE, begin_update, end_update
from estimation.window import (
    F_UNIT,
    R_CHI_A,
    R_CHI_B,
    R_FAILED,
    R_FAR,
    R_KNOWN,
    R_STEADY,
    R_STICK,
    R_TOLD,
    fit,
    knots_of,
)

_SIZE = LEVEL + 1


class _Room:
    """Arrays for moves of one length; what they hold does not outlive an update."""

    __slots__ = (
        "columns", "heading", "p", "ready", "samples", "steady", "tables", "usable", "zone",
    )  # fmt: skip

    def __init__(self, samples: int, knots: int) -> None:
        rows = max(samples - 2, 0)
        self.samples = samples
        self.tables, self.columns = np.empty((TABLES, samples)), np.empty((KNOTS, rows))
        self.heading, self.zone = np.empty(rows, np.int8), np.empty(rows, np.int8)
        self.usable, self.ready = np.empty(rows, np.bool_), np.empty(rows, np.int8)
        self.p = np.empty(KNOTS + knots)
        self.steady = np.zeros(samples, np.bool_)


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
        self._settings = settings
        # What the kernels take, made once.
        self.units = settings.units(friction)
        self._constants = settings.constants(friction)
        self._figures = np.ascontiguousarray(self.units[F_UNIT])
        self._shape = np.array([friction.stribeck_velocity, friction.stribeck_shape])
        self._masks = settings.masks(frozen)
        self._short = self._masks.copy()  # for moves that do not go far
        self._short[:, RATE] = False
        self._calm = self._masks.copy()  # for those that settle at once
        self._calm[:, STIFFNESS] = False
        self._shares = element_shares(friction.elements).copy()
        self._elements = np.empty((ELEMENT_ROWS, friction.elements + 1))
        self._elements[SHARES, :-1] = self._shares
        self._ends_at, self._slips = self._elements[FORCE, :-1], self._elements[SLIPS, :-1]
        self._before, self._found, self._at_end = np.empty(_SIZE), np.empty(_SIZE), np.empty(KNOTS)
        self._spread, self._uncertain = np.empty((_SIZE, _SIZE)), np.empty((_SIZE, _SIZE))
        self._room = _Room(0, 0)

    def _room_for(self, samples: int) -> _Room:
        if self._room.samples != samples:
            settings = self._settings
            knots = knots_of(max(samples - 2, 0), settings.period, settings.belief.wander)
            self._room = _Room(samples, knots)
        return self._room

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
    ) -> F64:
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
            What it left, see `update`.

        Raises:
            ValueError: shapes that differ, or fewer than three valid samples.
        """
        samples = len(move.position)
        upset = samples if move.upset is None else len(move.upset)
        if not len(move.force) == len(move.valid) == upset == samples:
            raise ValueError("position, force and valid must have the same length")
        room, result = self._room_for(samples), np.empty(UPDATE_SIZE)
        tables, heading, zone, usable = room.tables, room.heading, room.zone, room.usable
        ready, p, settings = room.ready, room.p, self._settings
        mean, covariance = belief.mean, belief.covariance
        before, spread, found, uncertain = self._before, self._spread, self._found, self._uncertain
        constants, units, shares, forces = self._constants, self.units, self._shares, state.forces
        drift = settings.belief.drift[COULOMB]
        units[F_DRIFT, COULOMB] = math.hypot(drift, math.sqrt(restless) * float(mean[COULOMB]))
        counted = begin_update(
            move.position, move.force, move.valid,
            room.steady if move.upset is None else move.upset, rest, move.rest_force, elapsed,
            constants, units, shares, mean, covariance, forces, state.memory, known, whole, tables,
            heading, zone, usable, ready, before, spread, found, uncertain, p, result,
        )  # fmt: skip
        if counted < 3:
            raise ValueError("fewer than three valid samples")
        masks = self._masks if result[R_FAR] else self._short
        if not result[R_TOLD]:
            masks = self._calm
        fit(
            tables, heading, zone, usable, ready, constants, units, shares, forces, before,
            spread, found, uncertain, masks, p, result,
        )  # fmt: skip
        misfit = math.sqrt(result[R_CHI_B] if result[R_STICK] > 0.0 else result[R_CHI_A])
        # What is left between jolts of the drive is not free of them either.
        doubt = max(misfit, 1.0 / max(result[R_STEADY], MOSTLY) ** 2)
        if misfit <= settings.misfit and doubt > 1.0 and whole and result[R_FAILED] == 0.0:
            tamed = tempered(Belief(before, spread), Belief(found, uncertain), doubt)
            if not self._jumps_away(before, spread, found):  # that is for `end_update` to see
                found[:], uncertain[:] = tamed.mean, tamed.covariance
        at_end, elements = self._at_end, self._elements
        reshaped = end_update(
            samples, constants, self._masks, before, spread, found, uncertain, whole, mean,
            covariance, at_end, result,
        )  # fmt: skip
        if reshaped:
            ready.fill(0)
        lead(
            at_end, self._figures, self._shape, settings.position_noise, settings.period, forces,
            float(result[R_KNOWN]), move.rest_force, tables, heading, ready, False,
            False, room.columns, elements,
        )  # fmt: skip
        forces[:], state.slipping[:] = self._ends_at, self._slips
        return result

    def _jumps_away(self, before: F64, spread: F64, found: F64) -> bool:
        """Whether a figure changes by more than drift can explain."""
        change = np.abs(found[:MASS] / before[:MASS] - 1.0)
        sigma = np.sqrt(spread.diagonal()[:MASS]) / before[:MASS]
        allowed = np.maximum(self._settings.jump * sigma, self._settings.jump_share)
        return bool((change > allowed).any())


def tempered(prior: Belief, found: Belief, misfit: float) -> Belief:
    """What is believed where the residual is `misfit` times what noise explains.

    The move's information counts by 1/misfit^2, as if its noise had been that much larger. A
    figure of which nothing is free keeps what was found.
    """
    if misfit <= 1.0:
        return found
    free = found.covariance.diagonal() < prior.covariance.diagonal() * (1.0 - 1e-9)
    if not free.any():
        return found
    chosen = np.ix_(free, free)
    before = np.linalg.inv(prior.covariance[chosen])
    after = np.linalg.inv(found.covariance[chosen])
    share = 1.0 / misfit**2
    information = before + share * (after - before)
    covariance = np.linalg.inv(information)
    pull = (1.0 - share) * before @ prior.mean[free] + share * after @ found.mean[free]
    mean, whole = found.mean.copy(), found.covariance.copy()
    mean[free] = covariance @ pull
    whole[chosen] = covariance
    return Belief(mean, whole)
