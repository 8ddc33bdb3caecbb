"""The force that no effect explains, as a report describes it and simulations have it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hil_sim.effects.residual_table import MOST_NODES
from sim2real.json_numbers import Nodes, Number, NumberIfAny

_PER_PERIOD = 40
"""Nodes per period of a force that repeats itself, beyond those recorded."""


@dataclass(frozen=True, slots=True)
class EmpiricalForce:
    """A description, not a cause, of the force that no effect explains.

    F = always(x) + against(x) sgn(v) + over_velocity(v), each linear between its nodes, with what
    is lost over motor force, elements that resist after a reversal, and an encoder's error, where
    these are needed.

    Attributes:
        axis: its name.
        gap_closed: share of the gap in force along the motion that it closes on held-out strokes.
        position: nodes [m].
        always, against: forces at these nodes [N].
        velocity: nodes [m/s].
        over_velocity: forces at these nodes [N].
        coulomb: `against` as a factor on the model's Coulomb force, at the nodes over position; 1
            where that force is below the floor, and `against` is 0 there.
        motor_force: nodes over the measured motor force [N]; empty where nothing is lost.
        lost: motor force that does not reach the carriage there [N].
        path: travel after which each element slides [m]; empty where there are none.
        resistance: force at which each of them slides [N].
        turned: change of the motor force after which each element slides that loses some of it [N];
            empty where there are none.
        lagging: what each of them loses then [N].
        gain_at: nodes over position of a factor on the motor force [m]; empty where it has none.
        gain: the factor there.
        reading: nodes over position of an encoder's error [m]; empty where it reads right.
        misread: what it reads too much there [m].
        period: distance after which the forces over position repeat themselves [m]; 0 where none is
            known.
    """

    axis: str
    gap_closed: Number
    position: tuple[Number, ...]
    always: tuple[Number, ...]
    against: tuple[Number, ...]
    coulomb: tuple[Number, ...] = field(default=(), kw_only=True)
    velocity: tuple[Number, ...]
    over_velocity: tuple[Number, ...]
    motor_force: Nodes = field(default=(), kw_only=True)
    lost: Nodes = field(default=(), kw_only=True)
    path: Nodes = field(default=(), kw_only=True)
    resistance: Nodes = field(default=(), kw_only=True)
    turned: Nodes = field(default=(), kw_only=True)
    lagging: Nodes = field(default=(), kw_only=True)
    gain_at: Nodes = field(default=(), kw_only=True)
    gain: Nodes = field(default=(), kw_only=True)
    reading: Nodes = field(default=(), kw_only=True)
    misread: Nodes = field(default=(), kw_only=True)
    period: NumberIfAny = field(default=0.0, kw_only=True)

    def effects(self) -> list[tuple[str, dict[str, float | tuple[float, ...]]]]:
        """Names and values of the effects that have this force in simulations."""
        found: list[tuple[str, dict[str, float | tuple[float, ...]]]] = []
        if any((*self.always, *self.over_velocity)) or set(self.coulomb) - {1.0}:
            found.append(("residual_table", {**self.table()}))
        if self.motor_force:
            found.append(("motor_loss_table", {"motor_force": self.motor_force, "loss": self.lost}))
        for path, force in zip(self.path, self.resistance, strict=True):
            found.append(("cable_hysteresis", {"force": force, "stiffness": force / path}))
        if self.turned:
            found.append(("motor_hysteresis_table", {"width": self.turned, "loss": self.lagging}))
        if self.gain_at:
            at, gain = self._going_on(self.gain_at, self.gain)
            found.append(("motor_gain_table", {"position": at, "factor": gain}))
        if self.reading:
            found.append(("misreading_table", {"position": self.reading, "error": self.misread}))
        return found

    def table(self) -> dict[str, tuple[float, ...]]:
        """Values of the effect `residual_table`."""
        places, always, coulomb = self._going_on(self.position, self.always, self.coulomb)
        return {
            "position": places,
            "force": always,
            "coulomb": coulomb,
            "velocity": self.velocity,
            "velocity_force": self.over_velocity,
        }

    def _going_on(self, places: Nodes, *tables: Nodes) -> tuple[Nodes, ...]:
        """Nodes over position, and tables that repeat themselves beyond those recorded."""
        if not self.period:
            return places, *tables
        low, high = places[0], places[-1]
        most = min((high - low) / self.period * _PER_PERIOD, (MOST_NODES - len(places)) / 2)
        beyond = self.period / _PER_PERIOD * np.arange(1.0, most)
        at = np.concatenate((low - beyond[::-1], places, high + beyond))
        away = np.ceil((low - at) / self.period).clip(0) - np.ceil((at - high) / self.period).clip(
            0
        )
        within = at + self.period * away
        return tuple(at), *(tuple(np.interp(within, places, table)) for table in tables)
