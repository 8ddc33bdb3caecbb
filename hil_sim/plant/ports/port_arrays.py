"""The ports of all axes in the form that the compiled plant takes: one record per axis, one arena.

The arena is one flat float64 array with every table, list and extra state of all axes; the records
hold their offsets in it (-1: none). However many effects there are, a call of the kernel takes only
one more array.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.ports import VELOCITY_NODES, EffectPorts, Oscillator
from hil_sim.plant.coarse_weights import motor_weights
from hil_sim.settings import SUBSTEPS, StageSettings

F64 = NDArray[np.float64]

PORT_FIELDS = [
    ("ported", "?"),  # differs from the plain plant
    ("coupled", "?"),  # the axes are solved jointly
    ("gain", "f8"),
    ("saturation", "f8"),
    ("coulomb_forward", "f8"),
    ("coulomb_backward", "f8"),
    ("force", "f8"),
    ("spring", "f8"),
    ("mobility", "f8"),  # relative acceleration per force on the carriage [1/kg]
    ("table_low", "f8"),
    ("table_inverse", "f8"),
    ("table_count", "i8"),
    ("position_force", "i8"),
    ("position_coulomb", "i8"),
    ("position_gain", "i8"),
    ("misreading", "i8"),
    ("velocity_scale", "f8"),
    ("velocity_nodes", "i8"),
    ("velocity_force", "i8"),
    ("time_inverse", "f8"),
    ("time_count", "i8"),
    ("time_force", "i8"),
    ("time_coulomb", "i8"),
    ("harmonics", "i8"),
    ("harmonic_count", "i8"),
    ("decays", "i8"),
    ("decay_count", "i8"),
    ("hysteresis", "i8"),
    ("hysteresis_count", "i8"),
    ("hanging", "i8"),
    ("hanging_count", "i8"),
    ("bases", "i8"),
    ("base_count", "i8"),
    ("fields", "i8"),
    ("field_count", "i8"),
    ("history", "i8"),
    ("history_depth", "i8"),
    ("delay_ticks", "i8"),
    ("delay_share", "i8"),
    ("coupling", "i8"),
    ("end_old", "f8"),  # of a coarse step: `coarse_weights`
    ("end_start", "f8"),
    ("mean_old", "f8"),
    ("mean_start", "f8"),
    ("early_old", "f8"),
    ("early_start", "f8"),
    ("coarse_share", "f8"),
]
"""Fields of the plant's record; integers without a count are offsets in the arena."""

PORT_STATE_FIELDS = [
    ("clock", "i8"),  # control ticks since t = 0
    ("ring", "i8"),  # index of the newest output in the history
    ("late", "f8"),  # delayed output before and after its step within this tick
    ("later", "f8"),
    ("place", "f8"),  # position about which this tick is linearised [m]
    ("coulomb", "f8"),
    ("coulomb_slope", "f8"),
    ("gain", "f8"),
    ("gain_slope", "f8"),
    ("pull", "f8"),
    ("pull_slope", "f8"),
    ("push", "f8"),  # force over time at the tick's start [N], and its rate [N/s]
    ("push_rate", "f8"),
    ("misread", "f8"),  # error of the encoder reading [m]
    ("misread_slope", "f8"),
    ("net", "f8"),  # force on the carriage without coupling and springs [N]
    ("sprung", "f8"),  # force of the oscillators on it [N]
    ("springs", "f8"),  # acceleration by all springs and dampers [m/s^2]
    ("response", "f8"),  # change of motor force per change of measured force
    ("rise", "f8"),  # of the motor force along the travel [N/m]
    ("kick", "f8"),  # change of velocity in this substep [m/s]
    ("lead", "f8"),  # velocity that a coarse step adds to its displacement [m/s]
]
"""Fields of the state's record."""


_OFFSETS = (
    "position_force", "position_coulomb", "position_gain", "misreading", "velocity_force",
    "time_force", "time_coulomb", "harmonics", "decays", "hysteresis", "fields", "history",
)  # fmt: skip


class Arena:
    """Collects arrays into one flat array."""

    def __init__(self) -> None:
        self._parts: list[F64] = []
        self._used = 0

    def add(self, values: F64 | Sequence[float] | Sequence[Sequence[float]] | None) -> int:
        """Append values; return their offset, -1 if there are none."""
        if values is None or len(values) == 0:
            return -1
        part = np.ascontiguousarray(values, dtype=np.float64).ravel()
        self._parts.append(part)
        self._used += len(part)
        return self._used - len(part)

    def array(self) -> F64:
        """The whole array, never empty, float64[n]."""
        return np.concatenate([*self._parts, np.zeros(1)])


def build_ports(
    settings: StageSettings, duration: float | None, substeps: int = SUBSTEPS
) -> list[EffectPorts]:
    """Make the ports of all axes and let their effects write into them.

    Args:
        settings: of the stage.
        duration: of the simulation [s]; None: without end.
        substeps: plant steps per control tick.

    Raises:
        ValueError: naming axis, effect and reason.
    """
    ports = []
    for axis in settings.axes:
        own = EffectPorts(axis, settings.sync_period, duration)
        try:
            for effect in axis.effects:
                effect.apply(own)
            if axis.effects:
                own.check(settings.control_period / substeps)
            if (own.coupled_mass or own.fields) and len(settings.axes) != 2:
                raise ValueError("an effect that involves the other axis needs a stage of two")
        except ValueError as error:
            raise ValueError(f"axis {axis.name}: {error}") from error
        ports.append(own)
    return ports


def write_ports(
    record: np.void, ports: EffectPorts, arena: Arena, settings: StageSettings, substeps: int
) -> None:
    """Write the ports of one axis into its record and the arena.

    Args:
        record: of the axis, with its nominal values.
        ports: of the axis.
        arena: of all axes.
        settings: of the stage.
        substeps: plant steps per control tick.
    """
    _write_values(record, ports, settings.control_period, substeps)
    _write_tables(record, ports, arena, settings.sync_period)
    _write_lists(record, ports, arena)
    _write_dynamics(record, ports, arena)
    _write_delay(record, ports, arena, settings.control_period, substeps)
    record["ported"] = (
        ports.force_constant != 1.0
        or ports.coulomb_forward != 1.0
        or ports.coulomb_backward != 1.0
        or ports.force != 0.0
        or ports.spring != 0.0
        or ports.coupled_mass != 0.0
        or math.isfinite(ports.saturation)
        or bool(ports.hanging or ports.bases)
        or any(record[name] >= 0 for name in _OFFSETS)
    )


def _write_values(record: np.void, ports: EffectPorts, period: float, substeps: int) -> None:
    friction = ports.axis.friction
    record["mass"] = ports.mass
    record["viscous"] = ports.viscous
    record["element_stiffness"] = ports.stiffness / max(friction.elements, 1)
    record["static_ratio"] = ports.static_ratio
    record["coulomb"] = friction.coulomb * ports.coulomb
    record["current_gain"] = 1.0 - math.exp(-_decay(ports, period, substeps))
    record["gain"] = ports.force_constant
    record["saturation"] = ports.saturation if math.isfinite(ports.saturation) else 0.0
    record["coulomb_forward"] = ports.coulomb_forward
    record["coulomb_backward"] = ports.coulomb_backward
    record["force"] = ports.force
    record["spring"] = ports.spring


def _write_tables(record: np.void, ports: EffectPorts, arena: Arena, sync_period: float) -> None:
    """Write tables over position (padded at each end), velocity and time, and fields."""
    nodes = ports.positions
    record["table_low"] = nodes[0]
    record["table_inverse"] = (len(nodes) - 1) / (nodes[-1] - nodes[0])
    record["table_count"] = len(nodes)
    for name in ("position_force", "position_coulomb", "position_gain", "misreading"):
        table = getattr(ports, name)
        record[name] = arena.add(None if table is None else np.pad(table, 1, "edge"))
    record["velocity_scale"] = VELOCITY_NODES / math.sqrt(1.5 * ports.axis.velocity)
    record["velocity_nodes"] = VELOCITY_NODES
    record["velocity_force"] = arena.add(ports.velocity_force)
    record["time_inverse"] = 1.0 / sync_period
    for name in ("time_force", "time_coulomb"):
        table = getattr(ports, name)
        record[name] = arena.add(table)
        if table is not None:
            record["time_count"] = len(table)
    fields = [
        np.concatenate([*map(_grid, (f.own, f.other)), f.values.ravel()]) for f in ports.fields
    ]
    record["fields"] = arena.add(np.concatenate(fields) if fields else None)
    record["field_count"] = len(fields)


def _grid(nodes: F64) -> tuple[float, float, float]:
    """Count, first node and inverse distance of evenly spaced nodes."""
    return len(nodes), nodes[0], (len(nodes) - 1) / (nodes[-1] - nodes[0])


def _write_lists(record: np.void, ports: EffectPorts, arena: Arena) -> None:
    record["harmonics"] = arena.add([(a, 2.0 * math.pi * f, phi) for a, f, phi in ports.harmonics])
    record["harmonic_count"] = len(ports.harmonics)
    record["decays"] = arena.add([(a, 1.0 / tau) for a, tau in ports.decays])
    record["decay_count"] = len(ports.decays)
    record["hysteresis"] = arena.add([(k, f, 0.0) for f, k in ports.hysteresis])
    record["hysteresis_count"] = len(ports.hysteresis)


def _write_dynamics(record: np.void, ports: EffectPorts, arena: Arena) -> None:
    """Write the oscillators and the mobility of the carriage."""
    total = ports.mass
    hanging = []
    for part in ports.hanging:
        mass = part.mass_ratio * total
        if mass > 0.0:
            reduced = mass * (total - mass) / total
            hanging.append(_oscillator(part, mass, reduced))
    carriage = total - sum(h[2] for h in hanging)
    bases = []
    for part in ports.bases:
        if part.mass_ratio > 0.0:
            mass = total / part.mass_ratio
            bases.append(_oscillator(part, mass, mass))
    record["mass"] = carriage
    record["hanging"], record["hanging_count"] = arena.add(hanging), len(hanging)
    record["bases"], record["base_count"] = arena.add(bases), len(bases)
    record["mobility"] = 1.0 / carriage + sum(1.0 / b[2] for b in bases)


def _oscillator(part: Oscillator, mass: float, reduced: float) -> tuple[float, ...]:
    """Stiffness, damping, mass, and the initial deflection and rate; `reduced` mass of the mode."""
    rate = 2.0 * math.pi * part.frequency
    return reduced * rate**2, 2.0 * part.damping * reduced * rate, mass, 0.0, 0.0


def _write_delay(
    record: np.void, ports: EffectPorts, arena: Arena, period: float, substeps: int
) -> None:
    """Write the dead time: whole ticks, and per substep the weight of the earlier output.

    The current loop is a first-order lag: a step of its input within a substep acts like a
    weighted mean of both values over the whole substep.
    """
    record["history"] = record["delay_share"] = -1
    if ports.delay <= 0.0:
        return
    ticks = ports.delay / period
    whole = math.floor(ticks + 1e-9)
    step = max(0.0, ticks - whole) * substeps  # substeps until the output steps
    share = _shares_before(step, _decay(ports, period, substeps), substeps)
    record["delay_ticks"] = whole
    record["history_depth"] = whole + 2
    record["history"] = arena.add(np.zeros(whole + 2))
    record["delay_share"] = arena.add(share)


def _decay(ports: EffectPorts, period: float, steps: int) -> float:
    return 2.0 * math.pi * ports.current_bandwidth * period / steps


def _shares_before(step: float, decay: float, count: int) -> F64:
    """Weight of the earlier input in each of `count` integration steps, float64[count].

    Args:
        step: time at which the input changes, in integration steps.
        decay: 2 pi bandwidth times the integration step.
        count: number of integration steps.
    """
    before = np.clip(step - np.arange(count), 0.0, 1.0)
    old = (1.0 - np.exp(-decay * before)) * np.exp(-decay * (1.0 - before))
    return np.asarray(old / (1.0 - math.exp(-decay)))


def write_coarse_weights(record: np.void, ports: EffectPorts, period: float, fine: float) -> None:
    """Write the weights of coarse steps (`hil_sim.plant.coarse_weights`).

    Args:
        record: of the axis.
        ports: of the axis.
        period: Tc [s], a coarse step.
        fine: number of fine steps that it replaces; weights of a fraction are interpolated.
    """
    few = math.floor(fine)
    weights = _coarse_weights(ports, period, few)
    if fine > few:
        share = (1.0 / few - 1.0 / fine) / (1.0 / few - 1.0 / (few + 1))
        weights = weights + share * (_coarse_weights(ports, period, few + 1) - weights)
    for name, (old, start) in zip(("end", "mean", "early"), weights, strict=True):
        record[f"{name}_old"], record[f"{name}_start"] = old, start
    record["coarse_share"] = (fine + 1.0) / (2.0 * fine)


def _coarse_weights(ports: EffectPorts, period: float, fine: int) -> F64:
    decay = _decay(ports, period, fine)
    ticks = ports.delay / period
    step = max(0.0, ticks - math.floor(ticks + 1e-9)) * fine
    return motor_weights(decay, _shares_before(step, decay, fine))


def write_coupling(plant: np.ndarray, ports: Sequence[EffectPorts], arena: Arena) -> None:
    """Write the joint solution for the accelerations, if any axis is coupled.

    a = b + G (F - M a), so a = (I + G M)^-1 (b + G F): a the accelerations relative to the base, M
    the coupled masses, G the mobilities, F all other forces.
    """
    count = len(ports)
    masses = np.zeros((count, count))
    for a, own in enumerate(ports):
        if own.coupled_mass:
            masses[a, 1 - a] = own.coupled_mass
    if not masses.any():
        plant["coupling"] = -1
        return
    mobility = np.array([record["mobility"] for record in plant])
    inverse = np.linalg.inv(np.eye(count) + mobility[:, None] * masses)
    offset = arena.add(np.concatenate((inverse.ravel(), masses.ravel())))
    plant["coupling"] = offset
    plant["coupled"] = True
    plant["ported"] = True
