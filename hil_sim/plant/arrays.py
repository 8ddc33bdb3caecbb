"""A stage as the arrays that the compiled mechanics work on, at rest at the start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.ports import EffectPorts
from hil_sim.plant.control import (
    CASCADE_FIGURES,
    CONTROL_DTYPE,
    CONTROL_STATE_DTYPE,
    HELD_AT_POSITION,
    LOOP_FIGURES,
)
from hil_sim.plant.friction.gms import element_shares
from hil_sim.plant.friction.laws import NUMBERS, rest_forces
from hil_sim.plant.ports.current_loop import write_coarse_weights
from hil_sim.plant.ports.port_arrays import build_ports, write_coupling, write_ports
from hil_sim.plant.ports.records import PORT_FIELDS, PORT_STATE_FIELDS, Arena
from hil_sim.settings import SUBSTEPS, AxisSettings, CascadeSettings, ControlSettings, StageSettings
from stagedata import F64
from stagedata.fields import of_type

_FIGURES = (
    "mass", "viscous", "coulomb", "static_ratio", "stribeck_velocity", "stribeck_shape",
    "stribeck_end", "element_stiffness", "relaxation_rate", "increment", "noise", "wander",
    "wander_keep", "current_gain",
)  # fmt: skip
_PLANT = np.dtype(
    [*of_type("f8", *_FIGURES), *of_type("i8", "law", "elements", "first_element"), *PORT_FIELDS],
    align=True,
)
_STATE_FIGURES = (
    "position", "velocity", "motor_force", "friction", "direction", "wander", "encoder", "speed",
    "worst_error",
)  # fmt: skip
_STATE = np.dtype([*of_type("f8", *_STATE_FIGURES), *PORT_STATE_FIELDS])


Record = NDArray[np.void]


class Mechanics(NamedTuple):
    """What the kernels work on: A axes with E friction elements.

    Attributes:
        plant: records of the axes, [A]; read only.
        control: records of their loops, [A]; read only.
        state, loop: states of both, [A].
        forces: of the friction elements of all axes, float64[E] [N].
        slipping: whether each slips, bool[E].
        shares: nu of each, float64[E].
        arena: tables and extra states of all axes, float64[n] (`port_arrays`).
        period: control tick Tc [s].
        substeps: plant steps per control tick; fewer than 5: one coarse step.
        ticks: control ticks per SYNC period.
    """

    plant: Record
    control: Record
    state: Record
    loop: Record
    forces: F64
    slipping: NDArray[np.bool_]
    shares: F64
    arena: F64
    period: float
    substeps: int
    ticks: int


def _plant_record(axis: AxisSettings) -> dict[str, float]:
    friction = axis.friction
    period = axis.control.period
    keep = math.exp(-period / axis.correlation_time)
    return {
        "stribeck_velocity": friction.stribeck_velocity,
        "stribeck_shape": friction.stribeck_shape,
        "stribeck_end": friction.stribeck_velocity
        * 36.0 ** min(1.0 / friction.stribeck_shape, 99.0),
        "relaxation_rate": friction.relaxation_rate,
        "law": NUMBERS[friction.law],
        "elements": friction.elements,
        "increment": axis.increment,
        "noise": axis.noise,
        "on_load": axis.encoder_on_load,
        "wander": axis.wander * math.sqrt(1.0 - keep**2),
        "wander_keep": keep,
    }


def _control_record(control: ControlSettings) -> tuple[float, ...]:
    cascade = control.cascade or CascadeSettings(1.0, 1.0)
    return (
        *(getattr(control, name) for name in LOOP_FIGURES),
        *(getattr(cascade, name) for name in CASCADE_FIGURES),
        control.cascade is not None,
    )


def _require_fine_steps(ports: Sequence[EffectPorts], substeps: int) -> None:
    """Refuse effects that one coarse step cannot follow: a fit steps back from them."""
    for own in ports:
        if substeps < SUBSTEPS and own.axis.effects and own.fewest_substeps() > substeps:
            raise ValueError(f"axis {own.axis.name}: too stiff for a coarse step with its effects")


class Arrays:
    """A stage as arguments of the kernels, at rest at the given positions.

    Args:
        settings: of the stage, effects included.
        start: true position of each axis [m].
        duration: of the simulation [s]; None: without end.
        substeps: plant steps per control tick: 5 is the reference, more is finer, 1 coarse
            (`hil_sim.plant.coarse`). A plant that is too stiff for them gets as many as it needs,
            unless effects make it too stiff for a coarse step.
        level: factor on Fc at each SYNC of the duration, shape (K, axes); None: 1.
        fine: plant steps that a coarse one stands for, at least 5; of all axes or of each.

    Raises:
        ValueError: effects that cannot be, naming axis and effect; substeps of 2..4, or 1 with
            another friction law than gms or with effects that make the plant too stiff.
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
        for axis in axes:
            if substeps < SUBSTEPS and axis.friction.law != "gms":
                raise ValueError(
                    f"axis {axis.name}: the friction law {axis.friction.law} needs at least "
                    f"{SUBSTEPS} plant steps per control tick"
                )
        self.ports = build_ports(settings, duration)
        needed = max(ports.fewest_substeps() for ports in self.ports)
        if substeps < needed:
            _require_fine_steps(self.ports, substeps)
            substeps = max(needed, SUBSTEPS)
        self._steps = settings.control_period, substeps, settings.ticks
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
            write_ports(record, ports, arena, settings, substeps)
            if substeps < SUBSTEPS:
                write_coarse_weights(record, ports, settings.control_period, float(fines[a]))
        write_coupling(self.plant, self.ports, arena)
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

    @property
    def mechanics(self) -> Mechanics:
        """These arrays as the kernels take them."""
        return Mechanics(
            self.plant, self.control, self.state, self.loop, self.forces, self.slipping,
            self.shares, self.arena, *self._steps,
        )  # fmt: skip

    def balance(self, a: int, force: float, axis: AxisSettings) -> None:
        """Let motor, friction and disturbances of one axis hold each other.

        Args:
            a: number of the axis.
            force: of the motor as measured [N]; less where friction cannot hold it.
            axis: settings of the axis.
        """
        ports, record = self.ports[a], self.plant[a]
        pull = ports.standing_force(float(self.state[a]["position"]))
        asked = ports.force_constant * force - pull
        place = self.state["position"].tolist()
        across = next((p for b, p in enumerate(place) if b != a), 0.0)
        level = ports.standing_level(place[a], across)
        static = axis.friction.coulomb * level * (1.0 + ports.static_ratio)
        static *= ports.coulomb_forward if asked > 0.0 else ports.coulomb_backward
        forces, held = rest_forces(axis.friction, static, asked)
        motor = (held + pull) / ports.force_constant
        self.forces[self._elements(a)] = forces
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
