"""The stage's mechanics and drive loops, all axes jointly, compiled.

Order of one control tick at time t, as docs/reference-stage.md states it: the encoder reading taken
at t feeds the position loop, whose output drives the current loop and the plant until t + Tc, where
the encoder is read again. The plant is integrated in steps of Tc/5, semi-implicit Euler.

`Plant` is stepped by the virtual drives, `simulate` runs whole demands at once: the same kernel.
Not modelled: power electronics, commutation, cables, the machine's base.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from hil_sim.control import (
    CONTROL_DTYPE,
    CONTROL_STATE_DTYPE,
    advance_demand,
    position_loop,
)
from hil_sim.friction import element_shares, slip_step, stribeck
from hil_sim.settings import AxisSettings, StageSettings

F64 = NDArray[np.float64]

SUBSTEPS = 5  # plant steps per control tick
_NOISE_BLOCK = 4096  # control ticks of noise drawn at once
_SPEED_TIME = 1e-3  # low-pass of the encoder velocity that 0x606C reports [s]

_PLANT = np.dtype(
    [
        ("mass", "f8"),
        ("viscous", "f8"),
        ("coulomb", "f8"),
        ("static_ratio", "f8"),
        ("stribeck_velocity", "f8"),
        ("stribeck_shape", "f8"),
        ("element_stiffness", "f8"),
        ("relaxation_rate", "f8"),
        ("elements", "i8"),
        ("increment", "f8"),
        ("noise", "f8"),
        ("wander", "f8"),
        ("wander_keep", "f8"),
        ("current_gain", "f8"),
    ]
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
    ]
)


@numba.njit(cache=True)
def _read_encoder(plant, state, control_period, normal):  # type: ignore[no-untyped-def]
    """Quantised position with noise; the speed that the drive reports follows it."""
    reading = round((state.position + plant.noise * normal) / plant.increment) * plant.increment
    state.speed += (
        control_period
        / (_SPEED_TIME + control_period)
        * ((reading - state.encoder) / control_period - state.speed)
    )
    state.encoder = reading


@numba.njit(cache=True)
def command(loop, position, force, ticks):  # type: ignore[no-untyped-def]
    """Ramp demand and force offset from the last commanded pair to this one within `ticks`."""
    loop.from_position = loop.demand
    loop.from_force = loop.offset
    loop.to_position = position
    loop.to_force = force
    loop.ramp_ticks = ticks
    loop.ramp_done = 0


@numba.njit(cache=True)
def _step(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, period, normals, first, ticks,
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
    _advance(plant, control, state, loop, forces, slipping, shares, period, normals, first, ticks)
    for a in range(plant.shape[0]):
        report[a, 0] = round(state[a].encoder / plant[a].increment)
        report[a, 1] = state[a].motor_force
        report[a, 2] = loop[a].demand
        report[a, 3] = state[a].speed
        report[a, 4] = state[a].worst_error


@numba.njit(cache=True)
def _advance(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, period, normals, first, ticks
):  # fmt: skip
    """Advance every axis by `ticks` control ticks; their noise starts at `normals[..., first]`."""
    axes = plant.shape[0]
    dt = period / SUBSTEPS
    for tick in range(first, first + ticks):
        for a in range(axes):
            advance_demand(loop[a])
            if loop[a].powered:
                error = position_loop(control[a], loop[a], state[a].encoder, period)
                state[a].worst_error = max(state[a].worst_error, abs(error))
        for _ in range(SUBSTEPS):
            for a in range(axes):
                p = plant[a]
                s = state[a]
                s.motor_force += p.current_gain * (loop[a].output - s.motor_force)
                v = s.velocity + dt / p.mass * (s.motor_force - s.friction - p.viscous * s.velocity)
                dx = v * dt
                s.velocity = v
                s.position += dx
                if v != 0.0:
                    direction = math.copysign(1.0, v)
                    if direction != s.direction:
                        s.direction = direction
                        for i in range(p.elements):
                            slipping[a, i] = False
                    curve = stribeck(v, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
                    s.friction = slip_step(
                        forces[a],
                        slipping[a],
                        shares[a],
                        p.elements,
                        direction,
                        dx,
                        p.element_stiffness,
                        p.coulomb * curve * (1.0 + s.wander),
                        math.exp(-p.relaxation_rate * dt / curve),
                    )
        for a in range(axes):
            p = plant[a]
            s = state[a]
            s.wander = p.wander_keep * s.wander + p.wander * normals[a, 1, tick]
            _read_encoder(p, s, period, normals[a, 0, tick])


@numba.njit(cache=True)
def _simulate(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, period, ticks, normals, demand, offset,
    unit, position_out, force_out,
):  # fmt: skip
    """Run whole demands: row k of every array is SYNC k."""
    axes = plant.shape[0]
    for k in range(demand.shape[0]):
        for a in range(axes):
            position_out[k, a] = state[a].encoder
            force_out[k, a] = round(state[a].motor_force / unit[a]) * unit[a]
            command(loop[a], demand[k, a], offset[k, a], ticks)
        _advance(
            plant, control, state, loop, forces, slipping, shares, period, normals, k * ticks, ticks
        )


def _plant_record(axis: AxisSettings) -> tuple[float, ...]:
    friction = axis.friction
    period = axis.control.period
    keep = math.exp(-period / friction.correlation_time)
    return (
        axis.mass,
        friction.viscous,
        friction.coulomb,
        friction.static_ratio,
        friction.stribeck_velocity,
        friction.stribeck_shape,
        friction.stiffness / friction.elements,
        friction.attraction / friction.coulomb,
        friction.elements,
        axis.increment,
        axis.noise,
        friction.wander * math.sqrt(1.0 - keep**2),
        keep,
        1.0 - math.exp(-2.0 * math.pi * axis.control.current_bandwidth * period / SUBSTEPS),
    )


class _Arrays:
    """The kernel's arguments for a stage at rest at the given positions."""

    def __init__(self, settings: StageSettings, start: Sequence[float]) -> None:
        axes = settings.axes
        widest = max(a.friction.elements for a in axes)
        self.plant = np.array([_plant_record(a) for a in axes], dtype=_PLANT)
        self.control = np.array(
            [
                (c.kp, c.ki, c.kd, c.derivative_time, c.peak_force)
                for c in (a.control for a in axes)
            ],
            dtype=CONTROL_DTYPE,
        )
        self.state = np.zeros(len(axes), dtype=_STATE)
        self.loop = np.zeros(len(axes), dtype=CONTROL_STATE_DTYPE)
        self.forces = np.zeros((len(axes), widest))
        self.slipping = np.zeros((len(axes), widest), dtype=np.bool_)
        self.shares = np.zeros((len(axes), widest))
        for a, axis in enumerate(axes):
            self.shares[a, : axis.friction.elements] = element_shares(axis.friction.elements)
            reading = round(start[a] / axis.increment) * axis.increment
            self.state[a]["position"] = start[a]
            self.state[a]["encoder"] = reading
            for name in ("demand", "from_position", "to_position"):
                self.loop[a][name] = reading

    def balance(self, a: int, force: float, axis: AxisSettings) -> None:
        """Let motor and friction of one axis hold each other at `force` [N]."""
        friction = axis.friction
        limits = self.shares[a, : friction.elements] * friction.coulomb
        limits = limits * (1.0 + friction.static_ratio)
        elements = np.zeros(friction.elements)
        for _ in range(friction.elements):
            free = np.abs(elements) < limits
            missing = force - float(elements.sum())
            if abs(missing) < 1e-12 or not free.any():
                break
            elements[free] += missing / free.sum()
            np.clip(elements, -limits, limits, out=elements)
        held = float(elements.sum())
        self.forces[a, : friction.elements] = elements
        self.state[a]["friction"] = held
        self.state[a]["motor_force"] = held
        self.loop[a]["integral"] = held - self.loop[a]["offset"]


class _Noise:
    """Encoder noise and friction wander, drawn in order from one stream per axis and source.

    seed None: none of either.
    """

    def __init__(self, axes: int, seed: int | None) -> None:
        self._axes = axes
        self._streams = (
            None
            if seed is None
            else [
                [np.random.default_rng([seed, axis, source]) for source in range(2)]
                for axis in range(axes)
            ]
        )

    def start_wander(self, settings: StageSettings) -> F64:
        """A stationary first value of the factor on Fc, per axis."""
        if self._streams is None:
            return np.zeros(self._axes)
        return np.array(
            [
                stream[1].standard_normal() * axis.friction.wander
                for stream, axis in zip(self._streams, settings.axes, strict=True)
            ]
        )

    def draw(self, ticks: int) -> F64:
        """Standard normals for the next ticks, shape (axes, 2, ticks)."""
        if self._streams is None:
            return np.zeros((self._axes, 2, ticks))
        return np.array([[s.standard_normal(ticks) for s in pair] for pair in self._streams])


class Plant:
    """A stage that is stepped in control ticks, its loops closed or open axis by axis.

    Args:
        settings: of the stage.
        seed: of encoder noise and friction wander; None for neither.
        start: true position of each axis [m]; default all 0. At rest, all friction states zero.

    Attributes:
        time_ns: start of the next control tick that has not been integrated.
    """

    def __init__(
        self, settings: StageSettings, seed: int | None, start: Sequence[float] | None = None
    ) -> None:
        count = len(settings.axes)
        self.settings = settings
        self.time_ns = 0
        self._period = settings.control_period
        self._period_ns = round(self._period * 1e9)
        self._arrays = _Arrays(settings, [0.0] * count if start is None else start)
        self._noise = _Noise(count, seed)
        arrays = self._arrays
        arrays.state["wander"] = self._noise.start_wander(settings)
        self._normals = self._noise.draw(_NOISE_BLOCK)
        self._used = 0
        # Orders wait for the next step; its report is kept as plain floats.
        self._orders = np.zeros((count, 5))
        self._order_rows: list[Any] = [memoryview(row) for row in self._orders]  # type: ignore[arg-type]
        self._report = np.zeros((count, 5))
        self._report[:, 0] = np.round(arrays.state["encoder"] / arrays.plant["increment"])
        self._report[:, 2] = arrays.state["encoder"]
        self._values: list[list[float]] = self._report.tolist()
        self._kernel = (
            arrays.plant, arrays.control, arrays.state, arrays.loop, arrays.forces,
            arrays.slipping, arrays.shares, self._period,
        )  # fmt: skip

    def advance_to(self, time_ns: int) -> None:
        """Integrate all control ticks that start before `time_ns`; no effect for the past."""
        if time_ns <= self.time_ns:
            return
        ticks = -((self.time_ns - time_ns) // self._period_ns)
        self.time_ns += ticks * self._period_ns
        while ticks > 0:
            if self._used == _NOISE_BLOCK:
                self._normals = self._noise.draw(_NOISE_BLOCK)
                self._used = 0
            part = min(ticks, _NOISE_BLOCK - self._used)
            _step(*self._kernel, self._normals, self._used, part, self._orders, self._report)
            self._used += part
            ticks -= part
        self._values = self._report.tolist()

    def power(self, axis: int, on: bool) -> None:
        """Close the loop (demand := actual, integrator and offset := 0) or cut the force."""
        loop = self._arrays.loop[axis]
        reading = float(self._arrays.state[axis]["encoder"])
        for name in ("demand", "from_position", "to_position"):
            loop[name] = reading
        for name in (
            "offset", "from_force", "to_force", "integral", "derivative", "last_error", "output",
            "ramp_ticks", "ramp_done",
        ):  # fmt: skip
            loop[name] = 0
        loop["powered"] = on
        self._orders[axis] = (0.0, 0.0, 0.0, 0.0, 1.0)
        self._values[axis][2] = reading
        self._values[axis][4] = 0.0

    def command(self, axis: int, position: float, force: float, ticks: int) -> None:
        """Ramp demand [m] and force offset [N] linearly to this pair, reached after `ticks`."""
        order = self._order_rows[axis]
        order[0], order[1], order[2], order[3] = 1.0, position, force, ticks

    def encoder(self, axis: int) -> int:
        """Encoder counts at `time_ns`, from the plant's true zero."""
        return int(self._values[axis][0])

    def force(self, axis: int) -> float:
        """Measured motor force at `time_ns` [N]."""
        return self._values[axis][1]

    def demand(self, axis: int) -> float:
        """Position demand inside the drive [m]."""
        return self._values[axis][2]

    def velocity(self, axis: int) -> float:
        """Velocity as the drive reports it: from the encoder, low-passed [m/s]."""
        return self._values[axis][3]

    def following_error(self, axis: int) -> float:
        """Largest |demand - encoder| since this was last called [m]."""
        values = self._values[axis]
        worst, values[4] = values[4], 0.0
        self._order_rows[axis][4] = 1.0
        return worst


def warm_up(settings: StageSettings) -> None:
    """Compile (or load) what a `Plant` of these settings needs, before time matters."""
    scratch = Plant(settings, None)
    scratch.power(0, True)
    scratch.command(0, 0.0, 0.0, settings.ticks)
    scratch.advance_to(1)


@dataclass(frozen=True, slots=True)
class Response:
    """What the drives of a simulated stage report, sampled at each SYNC; float64, shape (K, axes).

    Attributes:
        position: position actual value [m].
        force: force actual value, rounded to 1/1000 of the rated force [N].
    """

    position: F64
    force: F64


def simulate(
    settings: StageSettings,
    demand: F64,
    offset: F64,
    seed: int | None,
    rest_force: Sequence[float] | None = None,
) -> Response:
    """Closed-loop response to target positions and force offsets, from rest at the first target.

    Args:
        settings: of the stage.
        demand: target position sent for SYNC k [m], shape (K, axes).
        offset: force offset sent for SYNC k [N], shape (K, axes).
        seed: of encoder noise and friction wander; None for the noise-free response.
            Roundings of encoder and force stay.
        rest_force: motor force of each axis in the initial rest [N], balanced by its friction
            elements in equal parts (each at most its static limit); default 0.

    Raises:
        ValueError: shapes that do not fit.
    """
    demand = np.ascontiguousarray(demand, dtype=np.float64)
    offset = np.ascontiguousarray(offset, dtype=np.float64)
    count = len(settings.axes)
    if demand.ndim != 2 or demand.shape[1] != count or demand.shape != offset.shape:
        raise ValueError(
            f"demand and offset must both have shape (K, {count}), "
            f"have {demand.shape} and {offset.shape}"
        )
    position = np.empty_like(demand)
    force = np.empty_like(demand)
    if len(demand) == 0:
        return Response(position, force)
    arrays = _Arrays(settings, demand[0].tolist())
    for name in ("offset", "from_force", "to_force"):
        arrays.loop[name] = offset[0]
    arrays.loop["powered"] = True
    for a, held in enumerate([0.0] * count if rest_force is None else rest_force):
        arrays.balance(a, held, settings.axes[a])
    noise = _Noise(count, seed)
    arrays.state["wander"] = noise.start_wander(settings)
    unit = np.array([a.control.rated_force / 1000.0 for a in settings.axes])
    _simulate(
        arrays.plant, arrays.control, arrays.state, arrays.loop, arrays.forces, arrays.slipping,
        arrays.shares, settings.control_period, settings.ticks,
        noise.draw(len(demand) * settings.ticks), demand, offset, unit, position, force,
    )  # fmt: skip
    return Response(position, force)
