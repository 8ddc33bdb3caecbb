"""The force that no effect explains, as a report describes it and simulations have it."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim2real.json_numbers import Nodes, Number


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
            found.append(("motor_gain_table", {"position": self.gain_at, "factor": self.gain}))
        if self.reading:
            found.append(("misreading_table", {"position": self.reading, "error": self.misread}))
        return found

    def table(self) -> dict[str, tuple[float, ...]]:
        """Values of the effect `residual_table`."""
        return {
            "position": self.position,
            "force": self.always,
            "coulomb": self.coulomb,
            "velocity": self.velocity,
            "velocity_force": self.over_velocity,
        }
