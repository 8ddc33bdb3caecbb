"""The stage's mechanics with its drive loops, all axes jointly, compiled.

One kernel for every stage: what the plain model does not have enters through ports
(`hil_sim.disturbances`), and an axis without any takes the plain path, to the bit.

Order of one control tick at time t, as docs/reference-stage.md states it: the encoder reading taken
at t feeds the position loop, whose output drives the current loop and the plant until t + Tc, where
the encoder is read again. The plant is integrated in steps of Tc/5, semi-implicit Euler.

Not modelled: power electronics, commutation; cables, the machine's base and much else are effects
(`hil_sim.effects`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from hil_sim.coarse import advance_coarsely
from hil_sim.control import (
    CONTROL_DTYPE,
    CONTROL_STATE_DTYPE,
    HELD_AT_POSITION,
    advance_demand,
    position_loop,
)
from hil_sim.disturbances import coulomb_factor, delayed, drag, drive, refresh, solve_jointly, swing
from hil_sim.encoder import read_encoder
from hil_sim.friction import element_shares, slip_step, stribeck
from hil_sim.port_arrays import (
    PORT_FIELDS,
    PORT_STATE_FIELDS,
    Arena,
    couple,
    fill,
    fill_coarse,
    opened,
)
from hil_sim.settings import SUBSTEPS, AxisSettings, CascadeSettings, ControlSettings, StageSettings

F64 = NDArray[np.float64]


_PLANT = np.dtype(
    [
        ("mass", "f8"),
        ("viscous", "f8"),
        ("coulomb", "f8"),
        ("static_ratio", "f8"),
        ("stribeck_velocity", "f8"),
        ("stribeck_shape", "f8"),
        ("stribeck_end", "f8"),
        ("element_stiffness", "f8"),
        ("relaxation_rate", "f8"),
        ("elements", "i8"),
        ("first_element", "i8"),
        ("increment", "f8"),
        ("noise", "f8"),
        ("wander", "f8"),
        ("wander_keep", "f8"),
        ("current_gain", "f8"),
        *PORT_FIELDS,
    ],
    align=True,
)
_STATE = np.dtype(
    [
        ("position", "f8"),
        ("velocity", "f8"),
        ("motor_force", "f8"),
        ("friction", "f8"),
        ("direction", "f8"),
        ("wander", "f8"),
        ("encoder", "f8"),
        ("speed", "f8"),
        ("worst_error", "f8"),
        *PORT_STATE_FIELDS,
    ]
)


@numba.njit(cache=True, error_model="numpy")
def command(loop, position, force, ticks):  # type: ignore[no-untyped-def]
    """Ramp demand and force offset from the last commanded pair to this one within `ticks`."""
    loop.from_position = loop.demand
    loop.from_force = loop.offset
    loop.to_position = position
    loop.to_force = force
    loop.ramp_ticks = ticks
    loop.ramp_done = 0


@numba.njit(cache=True, error_model="numpy")
def step(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, arena, period, normals, first, ticks,
    orders, report,
):  # fmt: skip
    """Take over the orders, advance, report: what `Plant` needs of one call."""
    for a in range(plant.shape[0]):
        if orders[a, 0] != 0.0:
            command(loop[a], orders[a, 1], orders[a, 2], int(orders[a, 3]))
            orders[a, 0] = 0.0
        if orders[a, 4] != 0.0:
            state[a].worst_error = 0.0
            orders[a, 4] = 0.0
    advance(
        plant, control, state, loop, forces, slipping, shares, arena, period, SUBSTEPS, normals,
        first, ticks,
    )  # fmt: skip
    for a in range(plant.shape[0]):
        report[a, 0] = round(state[a].encoder / plant[a].increment)
        report[a, 1] = state[a].motor_force
        report[a, 2] = loop[a].demand
        report[a, 3] = state[a].speed
        report[a, 4] = state[a].worst_error


@numba.njit(cache=True, error_model="numpy")
def _kick(p, s, arena, substep, dt):  # type: ignore[no-untyped-def]
    """Change of velocity of an axis with ports in this substep, but for coupling."""
    s.motor_force += p.current_gain * (delayed(p, s, arena, substep) - s.motor_force)
    resistance = s.friction + p.viscous * s.velocity
    s.kick = dt * drive(p, s, arena, substep * dt, s.motor_force, resistance)


@numba.njit(cache=True, error_model="numpy")
def advance(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, arena, period, substeps, normals, first,
    ticks,
):  # fmt: skip
    """Advance every axis by `ticks` control ticks; their noise starts at `normals[..., first]`."""
    if substeps < SUBSTEPS:
        advance_coarsely(
            plant, control, state, loop, forces, slipping, shares, arena, period, normals, first,
            ticks,
        )  # fmt: skip
        return
    axes = plant.shape[0]
    dt = period / substeps
    noisy = normals.shape[2] > 0
    coupled = plant[0].coupled
    for tick in range(first, first + ticks):
        for a in range(axes):
            advance_demand(loop[a])
            if loop[a].powered:
                error = position_loop(control[a], loop[a], state[a].encoder, period)
                state[a].worst_error = max(state[a].worst_error, abs(error))
        for a in range(axes):
            if plant[a].ported:
                refresh(
                    plant[a], state[a], state[axes - 1 - a].position, arena, loop[a].output, period
                )
        for substep in range(substeps):
            if coupled:
                for a in range(axes):
                    _kick(plant[a], state[a], arena, substep, dt)
                solve_jointly(plant, state, arena, dt)
            for a in range(axes):
                p = plant[a]
                s = state[a]
                if p.ported:
                    if not coupled:
                        _kick(p, s, arena, substep, dt)
                    v = s.velocity + s.kick
                else:
                    s.motor_force += p.current_gain * (loop[a].output - s.motor_force)
                    v = s.velocity + dt / p.mass * (
                        s.motor_force - s.friction - p.viscous * s.velocity
                    )
                dx = v * dt
                s.velocity = v
                s.position += dx
                level = p.coulomb
                if p.ported:
                    swing(p, s, arena, dt)
                    drag(p, arena, dx)
                    level *= coulomb_factor(p, s, v)
                if v != 0.0:
                    direction = math.copysign(1.0, v)
                    if direction != s.direction:
                        s.direction = direction
                        for i in range(p.first_element, p.first_element + p.elements):
                            slipping[i] = False
                    curve = stribeck(v, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
                    s.friction = slip_step(
                        forces,
                        slipping,
                        shares,
                        p.elements,
                        direction,
                        dx,
                        p.element_stiffness,
                        level * curve * (1.0 + s.wander),
                        math.exp(-p.relaxation_rate * dt / curve),
                        p.first_element,
                    )
        for a in range(axes):
            p = plant[a]
            s = state[a]
            if noisy:
                s.wander = p.wander_keep * s.wander + p.wander * normals[a, 1, tick]
                read_encoder(p, s, period, normals[a, 0, tick])
            else:
                s.wander = p.wander_keep * s.wander
                read_encoder(p, s, period, 0.0)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def run_demands(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, arena, period, substeps, ticks, normals,
    demand, offset, unit, position_out, force_out,
):  # fmt: skip
    """Run whole demands: row k of every array is SYNC k.

    `normals` of no ticks means no noise; a `unit` of 0 leaves the force as it is.
    """
    axes = plant.shape[0]
    for k in range(demand.shape[0]):
        for a in range(axes):
            position_out[k, a] = state[a].encoder
            force = state[a].motor_force
            force_out[k, a] = round(force / unit[a]) * unit[a] if unit[a] > 0.0 else force
            command(loop[a], demand[k, a], offset[k, a], ticks)
        advance(
            plant, control, state, loop, forces, slipping, shares, arena, period, substeps, normals,
            k * ticks, ticks,
        )  # fmt: skip


def _plant_record(axis: AxisSettings) -> dict[str, float]:
    friction = axis.friction
    period = axis.control.period
    keep = math.exp(-period / friction.correlation_time)
    return {
        "stribeck_velocity": friction.stribeck_velocity,
        "stribeck_shape": friction.stribeck_shape,
        "stribeck_end": friction.stribeck_velocity
        * 36.0 ** min(1.0 / friction.stribeck_shape, 99.0),
        "relaxation_rate": friction.attraction / friction.coulomb,
        "elements": friction.elements,
        "increment": axis.increment,
        "noise": axis.noise,
        "wander": friction.wander * math.sqrt(1.0 - keep**2),
        "wander_keep": keep,
    }


def _control_record(control: ControlSettings) -> tuple[float | bool, ...]:
    cascade = control.cascade or CascadeSettings(1.0, 1.0)
    return (
        control.kp,
        control.ki,
        control.kd,
        control.derivative_time,
        control.peak_force,
        control.cascade is not None,
        cascade.position_gain,
        cascade.velocity_integral,
        cascade.feedforward,
        cascade.span,
    )


class Arrays:
    """The kernel's arguments for a stage at rest at the given positions.

    Args:
        settings: of the stage, effects included.
        start: true position of each axis [m].
        duration: of the simulation [s]; None: without end.
        substeps: plant steps per control tick: 5 is the reference, more is finer, 1 coarse
            (`hil_sim.coarse`).
        level: factor on Fc at each SYNC of the duration, shape (K, axes); None: 1.
        fine: plant steps that a coarse one stands for, at least 5; of all axes or of each.

    Raises:
        ValueError: effects that cannot be, naming axis and effect; substeps of 2..4.
    """

    def __init__(
        self,
        settings: StageSettings,
        start: Sequence[float],
        duration: float | None = None,
        substeps: int = SUBSTEPS,
        level: F64 | None = None,
        fine: float | Sequence[float] = SUBSTEPS,
    ) -> None:
        if substeps != 1 and substeps < SUBSTEPS:
            raise ValueError(f"substeps must be 1 or at least {SUBSTEPS}, is {substeps}")
        axes = settings.axes
        self.ports = opened(settings, duration, substeps)
        for a, ports in enumerate(() if level is None else self.ports):
            ports.scale_time_coulomb(np.append(level[:, a], level[-1, a]))  # type: ignore[index]
        self.plant = np.zeros(len(axes), dtype=_PLANT)
        arena = Arena()
        first = 0
        fines = np.broadcast_to(fine, len(axes))
        for a, (record, axis, ports) in enumerate(zip(self.plant, axes, self.ports, strict=True)):
            for name, value in _plant_record(axis).items():
                record[name] = value
            record["first_element"] = first
            first += axis.friction.elements
            fill(record, ports, arena, settings, substeps)
            if substeps < SUBSTEPS:
                fill_coarse(record, ports, settings.control_period, float(fines[a]))
        couple(self.plant, self.ports, arena)
        self.arena = arena.array()
        self.control = np.array(
            [_control_record(a.control) for a in axes],
            dtype=CONTROL_DTYPE,
        )
        self.state = np.zeros(len(axes), dtype=_STATE)
        self.loop = np.zeros(len(axes), dtype=CONTROL_STATE_DTYPE)
        count = sum(a.friction.elements for a in axes)
        self.forces = np.zeros(count)
        self.slipping = np.zeros(count, dtype=np.bool_)
        self.shares = np.zeros(count)
        for a, axis in enumerate(axes):
            self.shares[self._elements(a)] = element_shares(axis.friction.elements)
            reading = round(start[a] / axis.increment) * axis.increment
            self.state[a]["position"] = start[a] - self.ports[a].misread(start[a])
            self.state[a]["encoder"] = reading
            for name in HELD_AT_POSITION:
                self.loop[a][name] = reading

    def balance(self, a: int, force: float, axis: AxisSettings) -> None:
        """Let motor, friction and disturbances of one axis hold each other.

        Args:
            a: number of the axis.
            force: of the motor as measured [N]; less where friction cannot hold it.
            axis: settings of the axis.
        """
        friction = axis.friction
        ports, record = self.ports[a], self.plant[a]
        limits = self.shares[self._elements(a)] * float(record["coulomb"])
        limits = limits * (1.0 + ports.static_ratio)
        pull = ports.standing_force(float(self.state[a]["position"]))
        asked = ports.force_constant * force - pull
        elements = np.zeros(friction.elements)
        for _ in range(friction.elements):
            free = np.abs(elements) < limits
            missing = asked - float(elements.sum())
            if abs(missing) < 1e-12 or not free.any():
                break
            elements[free] += missing / free.sum()
            np.clip(elements, -limits, limits, out=elements)
        held = float(elements.sum())
        motor = (held + pull) / ports.force_constant
        self.forces[self._elements(a)] = elements
        self.state[a]["friction"] = held
        self.state[a]["motor_force"] = motor
        self.loop[a]["integral"] = motor - self.loop[a]["offset"]
        if record["history"] >= 0:
            begin = int(record["history"])
            self.arena[begin : begin + int(record["history_depth"])] = motor

    def _elements(self, a: int) -> slice:
        """Where the friction elements of axis a are in the arrays of all axes."""
        first = int(self.plant[a]["first_element"])
        return slice(first, first + int(self.plant[a]["elements"]))

    def restart_clock(self) -> None:
        """Make now t = 0 for everything that depends on time."""
        self.state["clock"] = 0
