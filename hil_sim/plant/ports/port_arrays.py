"""The ports of all axes, written into the records and the arena of the compiled plant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hil_sim.effects.ports import VELOCITY_NODES, EffectPorts, Oscillator
from hil_sim.plant.ports.current_loop import decay_of, write_delay
from hil_sim.plant.ports.records import LISTS, TABLES, Arena
from hil_sim.settings import StageSettings
from stagedata import F64

_FIGURES = (
    "mass", "viscous", "static_ratio", "coulomb_forward", "coulomb_backward", "force", "spring",
    "motor_share",
)  # fmt: skip
"""That stand in the record as they stand in the ports."""


def build_ports(settings: StageSettings, duration: float | None) -> list[EffectPorts]:
    """Make the ports of all axes and let their effects write into them.

    Args:
        settings: of the stage.
        duration: of the simulation [s]; None: without end.

    Raises:
        ValueError: naming axis, effect and reason.
    """
    ports = []
    for axis in settings.axes:
        try:
            own = EffectPorts.filled(axis, settings.sync_period, duration, settings.start)
            own.check(len(settings.axes))
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
    write_delay(record, ports, arena, settings.control_period, substeps)
    record["ported"] = (
        ports.force_constant != 1.0
        or ports.coulomb_forward != 1.0
        or ports.coulomb_backward != 1.0
        or ports.force != 0.0
        or ports.spring != 0.0
        or ports.coupled_mass != 0.0
        or ports.load_friction != 0.0
        or math.isfinite(ports.saturation)
        or any(record[name] >= 0 for name in (*TABLES, *LISTS, "history"))
    )


def _write_values(record: np.void, ports: EffectPorts, period: float, substeps: int) -> None:
    friction = ports.axis.friction
    for name in _FIGURES:
        record[name] = getattr(ports, name)
    record["element_stiffness"] = ports.stiffness / max(friction.elements, 1)
    record["coulomb"] = friction.coulomb * ports.coulomb
    record["current_gain"] = 1.0 - math.exp(-decay_of(ports, period, substeps))
    record["gain"] = ports.force_constant
    record["load_friction"] = ports.load_friction / record["coulomb"]
    record["saturation"] = ports.saturation if math.isfinite(ports.saturation) else 0.0


def _write_tables(record: np.void, ports: EffectPorts, arena: Arena, sync_period: float) -> None:
    """Write tables over position (padded at each end), velocity, motor force and time."""
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
    record["motor_scale"] = VELOCITY_NODES / math.sqrt(1.5 * ports.axis.control.peak_force)
    record["motor_loss"] = arena.add(ports.motor_loss)
    record["time_inverse"] = 1.0 / sync_period
    for name in ("time_force", "time_coulomb"):
        table = getattr(ports, name)
        record[name] = arena.add(table)
        if table is not None:
            record["time_count"] = len(table)


def _grid(nodes: F64) -> tuple[float, float, float]:
    """Count, first node and inverse distance of evenly spaced nodes."""
    return len(nodes), nodes[0], (len(nodes) - 1) / (nodes[-1] - nodes[0])


def _write_lists(record: np.void, ports: EffectPorts, arena: Arena) -> None:
    """Write the lists, and what oscillators leave of the carriage: its mass and mobility."""
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
    record["mobility"] = 1.0 / carriage + sum(1.0 / b[2] for b in bases)
    lists: dict[str, list[Any]] = {
        "harmonics": [(a, 2.0 * math.pi * f, phi) for a, f, phi in ports.harmonics],
        "decays": [(a, 1.0 / tau) for a, tau in ports.decays],
        "hysteresis": [(k, f, 0.0) for f, k in ports.hysteresis],
        "lags": [(1.0 / width, loss, 0.0, 0.0) for width, loss in ports.lags],
        "hanging": hanging,
        "bases": bases,
        "fields": [
            np.concatenate([*map(_grid, (f.own, f.other)), f.values.ravel()]) for f in ports.fields
        ],
    }
    for name, rows in lists.items():
        record[name] = arena.add(np.concatenate(rows) if rows else None)
        record[f"{name}_count"] = len(rows)


def _oscillator(part: Oscillator, mass: float, reduced: float) -> tuple[float, ...]:
    """Stiffness, damping, mass, and the initial deflection and rate; `reduced` mass of the mode."""
    rate = 2.0 * math.pi * part.frequency
    return reduced * rate**2, 2.0 * part.damping * reduced * rate, mass, 0.0, 0.0


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
