"""Checks of a machine file beyond single values: consistency, ranges of CiA 402 integers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from drivers.settings import HOST_NODE
from stagectl.config.machine.drive import NO_BUS, POSITION_RANGE
from stagectl.config.machine.plausible import find_contradictions, find_implausible
from stagectl.config.parsing.yaml_nodes import Document
from stagedata import LAW_FIGURES

if TYPE_CHECKING:
    from stagectl.config.machine.drive import Drive
    from stagectl.config.machine.model import Axis, Bus, Machine
    from stagectl.config.machine.plant import Friction

UNSIGNED_RANGE = 2**32 - 1
"""Windows and accelerations are UNSIGNED32: fewer units than this (all ones: no window)."""
LONGEST_HOMING = 30 * 86_400.0
"""Limit of the time for twice the travel, which the driver allows for homing [s]."""
FORCE_RANGE = 32.767
"""CiA 402 forces are INTEGER16 in 1/1000 of the rated force: at most this multiple."""
BOTH_LOOPS = "cannot be combined with pid: only one of them"
"""What is wrong with the cascade of a drive that also has a pid."""

At = tuple[str | int, ...]


Refuse = Callable[[At, str], None]
"""Notes that the value at a place is refused for a reason."""


def check_machine(machine: Machine, document: Document) -> list[str]:
    """One line per problem; none for a consistent machine file."""
    problems: list[str] = []

    def refuse(location: At, reason: str) -> None:
        problems.append(document.problem(location, reason))

    _check_bus(machine.bus, refuse)
    _check_temperature(machine, refuse)
    nodes: dict[int, str] = {}
    first: float | None = None
    for name, axis in machine.axes.items():
        at = ("axes", name)
        if axis.node == HOST_NODE:
            refuse((*at, "node"), f"{HOST_NODE} is the host's own node id")
        elif axis.node in nodes:
            refuse((*at, "node"), f"{axis.node} is the node of axis {nodes[axis.node]} already")
        nodes.setdefault(axis.node, name)
        implausible = list(find_implausible(axis))
        for key, reason in implausible:
            refuse((*at, *key), reason)
        if implausible:  # other problems would only follow from it
            continue
        before = len(problems)
        _check_ranges(axis, at, refuse)
        _check_drive(axis.drive, (*at, "drive"), refuse)
        _check_friction(axis.plant.friction, (*at, "plant", "friction"), refuse)
        if len(problems) == before:  # else contradictions may only follow from it
            for key, reason in find_contradictions(axis, is_log=machine.bus.interface == NO_BUS):
                refuse((*at, *key), reason)
        sync, period = machine.bus.sync_period, axis.drive.control_period
        if period > sync or not _whole(sync / period):
            refuse(
                (*at, "drive", "control_period"),
                f"must divide bus.sync_period ({sync:g} s), is {period:g} s",
            )
        elif not math.isclose(period, first := first or period, rel_tol=1e-9):
            refuse((*at, "drive", "control_period"), "must be the same on all axes")
    return problems


def _check_bus(bus: Bus, refuse: Refuse) -> None:
    sync, window = bus.sync_period, bus.sync_window
    if bus.interface != NO_BUS and not _whole(sync / 1e-6):
        refuse(("bus", "sync_period"), f"must be a whole number of us, is {sync:.12g} s")
    if bus.sync_counter == 1:
        refuse(("bus", "sync_counter"), "must be 0 or 2 to 240")
    if window and not 10e-6 <= window <= sync:
        refuse(("bus", "sync_window"), f"must be 0 or 10 us to sync_period, is {window:.12g} s")


def _check_temperature(machine: Machine, refuse: Refuse) -> None:
    thermometer = machine.temperature
    if thermometer is None:
        return
    by_object = thermometer.axis is not None and thermometer.object is not None
    if by_object == (thermometer.plugin is not None):
        refuse(("temperature",), "needs axis and object, or plugin instead")
    elif by_object and thermometer.axis not in machine.axes:
        refuse(("temperature", "axis"), f"no such axis; there are {', '.join(machine.axes)}")


def _check_ranges(axis: Axis, at: At, refuse: Refuse) -> None:
    """Travel, limits and homing against the ranges of integers on the bus, and the travel."""
    low, high = axis.travel
    if low >= high:
        refuse((*at, "travel"), f"must be [lowest, highest], is [{low:g}, {high:g}]")
    unit = axis.drive.position_unit
    reach = POSITION_RANGE * unit
    if max(abs(low), abs(high)) >= reach:
        refuse(
            (*at, "travel"),
            f"beyond +-{reach:.4g} {axis.unit_of('m')}, the range of a position in "
            f"{_short(unit)}{axis.unit_of('m')} "
            "(drive.position_unit)",
        )
    drive, limits, homing = axis.drive, axis.limits, axis.homing
    speed_key = "position_unit" if drive.velocity_unit is None else "velocity_unit"
    speed = (drive.velocity_count, axis.unit_of("m/s"), speed_key)
    rate = (drive.acceleration_count, axis.unit_of("m/s^2"), "acceleration_unit")
    length = (unit, axis.unit_of("m"), "position_unit")
    for section, key, value, most, (step, dimension, unit_key) in (
        ("limits", "velocity", limits.velocity, POSITION_RANGE, speed),
        ("limits", "acceleration", limits.acceleration, UNSIGNED_RANGE, rate),
        ("limits", "following_error", limits.following_error, UNSIGNED_RANGE, length),
        ("limits", "position_window", limits.position_window, UNSIGNED_RANGE, length),
        ("homing", "velocity", homing.velocity, UNSIGNED_RANGE, speed),
        ("homing", "index_velocity", homing.index_velocity, UNSIGNED_RANGE, speed),
    ):
        steps = f"{_short(step)}{dimension} steps (drive.{unit_key})"
        there_and_back = 2.0 * (high - low) / value
        if value >= most * step:
            reason = f"beyond {most * step:.4g} {dimension}, the range of {steps}"
        elif round(value / step) < 1 and key != "position_window":  # which may be below one step
            reason = f"{value:g} {dimension} is nothing in {steps}"
        elif section == "homing" and there_and_back > LONGEST_HOMING:
            days = there_and_back / 86_400.0
            reason = f"at {value:g} {dimension} the travel there and back takes {days:.0f} days"
        else:
            continue
        refuse((*at, section, key), reason)
    if homing.velocity > limits.velocity:
        refuse((*at, "homing", "velocity"), "above the axis' velocity limit")


def _check_drive(drive: Drive, at: At, refuse: Refuse) -> None:
    if drive.pid is None and drive.cascade is None:
        refuse(at, "pid: missing (or a cascade instead)")
    if drive.pid is not None and drive.cascade is not None:
        refuse((*at, "cascade"), BOTH_LOOPS)
    if drive.peak_force < drive.rated_force:
        refuse((*at, "peak_force"), "must be at least rated_force")
    if drive.peak_force > FORCE_RANGE * drive.rated_force:
        refuse((*at, "peak_force"), f"must be at most {FORCE_RANGE} x rated_force")


def _check_friction(friction: Friction, at: At, refuse: Refuse) -> None:
    """The law's own figures, all of them and no others."""
    for name, field in type(friction).model_fields.items():
        if field.default is not None:  # required, or of every law
            continue
        given = getattr(friction, name) is not None
        if given != (name in LAW_FIGURES[friction.model]):
            reason = f"the law {friction.model} has no such figure" if given else "is missing"
            refuse((*at, name), reason)


def _short(value: float) -> str:
    """A value with an SI prefix: 1e-9 is "1 n"."""
    for scale, prefix in ((1e-9, "n"), (1e-6, "u"), (1e-3, "m")):
        if value < 999.9 * scale:
            return f"{value / scale:g} {prefix}"
    return f"{value:g} "


def _whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) < 1e-6 * max(1.0, ratio) and round(ratio) >= 1
