"""Scale and sign of a drive's numbers, by a move of 0.1 mm: what it does against what was asked.

A note beside the machine file keeps which axes were checked, and with which units; a run lists
those that were not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from drivers import Stage
from drivers.drive import Axis, Mode
from drivers.errors import ConfigurationError
from stagectl.config.machine import Machine
from stagectl.store.axis_notes import AxisNotes
from stagedata import F64

DISTANCE = 1e-4
"""Of the move [m]."""
_SPEEDS = (5e-4, 2e-4)
"""Of the two moves by the drive's own profile, whose times are compared [m/s]."""
_TIME, _REST = 0.4, 0.1
"""Of a streamed move, and before and after it [s]."""
_SHARE, _STEP, _STEPS, _LAGS = 0.3, 20, 10, 8
"""Force offset over the Coulomb force, SYNCs per step, steps, SYNCs in which a step must show."""
OFFSET, PUSH = "force offset, N", "its direction, m"
"""What is compared of force offsets."""
_UNITS = ("rated_force", "position_unit", "velocity_unit", "acceleration_unit", "lead")


@dataclass(frozen=True, slots=True)
class Compared:
    """One quantity.

    Attributes:
        what: it is.
        asked, found: [SI]; None: the drive cannot be asked, or does not show it.
        agrees: in sign, and in scale as far as a short move tells; None: not compared.
        remark: why, or what else is to be known.
    """

    what: str
    asked: float | None
    found: float | None
    agrees: bool | None
    remark: str = ""


def check_scale(stage: Stage, axis: Axis, machine: Machine) -> list[Compared]:
    """Moves an axis by 0.1 mm and back, by its own profile and by the stream, then pushes it.

    Args:
        stage: of this axis alone, booted; enabled by this in csp, as it stays.
        axis: of the stage.
        machine: whose axis it is: its travel and its friction.

    Raises:
        ConfigurationError: there is no room.
        DriverError: from the stage.
    """
    stage.enable()
    start, (low, high) = stage.positions[0], axis.settings.travel
    way = DISTANCE if start + DISTANCE <= high else -DISTANCE
    if not low <= start + way <= high:
        raise ConfigurationError(
            f"at {start:g} m there is no room for {DISTANCE:g} m within its travel", axis=axis.name
        )
    figures = machine.axes[axis.name].plant.friction.figures
    compared = [_profile_speed(stage, axis, way)]
    if not axis.streams:
        return [*compared, Compared("position, force", None, None, None, "csp is not offered")]
    compared += _streamed(stage, axis, way, figures.coulomb)
    return compared + _pushed(stage, axis, figures.coulomb)


def _profile_speed(stage: Stage, axis: Axis, way: float) -> Compared:
    """Velocity of the drive's own profiles, by how much longer the slower of two moves takes."""
    what = "profile velocity, m/s"
    try:
        axis.check_mode(Mode.PROFILE_POSITION)
    except ConfigurationError as missing:
        return Compared(what, None, None, None, str(missing))
    fast, slow = (min(speed, axis.settings.velocity) for speed in _SPEEDS)
    taken = []
    for speed, distance in ((fast, way), (slow, -way)):
        begin = stage.clock.now_ns()
        target = stage.targets[0] + distance
        stage.move_to(axis.name, target, speed, min(1.0, axis.settings.acceleration))
        taken.append((stage.clock.now_ns() - begin) * 1e-9)
    more = abs(way) * (1 / slow - 1 / fast)
    found = slow * more / max(taken[1] - taken[0], 1e-3)
    return Compared(what, slow, found, 0.7 < found / slow < 1.4)


def _streamed(stage: Stage, axis: Axis, way: float, coulomb: float) -> list[Compared]:
    """Position reached, and the force that it takes."""
    period = stage.settings.sync_period
    phase = np.linspace(0.0, math.pi, round(_TIME / period))
    there = way * (0.5 - 0.5 * np.cos(phase))
    rest = np.zeros(round(_REST / period))
    path = np.concatenate((rest, there, rest + way, there[::-1], rest))[:, None]
    origin = stage.targets[0]
    samples = stage.stream(origin + path, np.zeros_like(path))
    n, k = len(rest), len(phase)
    position, force = samples.position[:, 0] - origin, samples.force[:, 0]
    valid = samples.valid[:, 0]

    def mean(of: F64, first: int, last: int) -> float:
        return float(of[first:last][valid[first:last]].mean())

    reached = mean(position, n + k + n // 2, n + k + n) - mean(position, n // 2, n)
    found = [Compared("position, m", way, reached, abs(reached / way - 1) < 0.05)]
    if not axis.reports_force:
        return [*found, Compared("force, N", None, None, None, "0x6077 is not offered")]
    middle = n + k // 3, n + 2 * k // 3
    back = middle[0] + k + n, middle[1] + k + n
    friction = math.copysign(0.5, way) * (mean(force, *middle) - mean(force, *back))
    agrees = friction > 0 and 0.2 < friction / coulomb < 5
    remark = "against the machine file's Coulomb friction"
    return [*found, Compared("force along the move, N", coulomb, friction, agrees, remark)]


def _pushed(stage: Stage, axis: Axis, coulomb: float) -> list[Compared]:
    """What steps of the force offset do to force and position."""
    if not axis.accepts_force_offset:
        return [Compared(OFFSET, None, None, None, "0x60B2 is not offered")]
    asked = min(_SHARE * coulomb, axis.settings.peak_force / 4)
    signs = np.repeat([(-1.0) ** n for n in range(2 * _STEPS)], _STEP)
    offset = np.concatenate((np.zeros(_STEP), asked * signs, np.zeros(2 * _STEP)))[:, None]
    samples = stage.stream(np.full_like(offset, stage.targets[0]), offset)
    edges = _STEP * np.arange(2, 2 * _STEPS + 1)  # each a step of twice the offset
    rising = np.sign(offset[edges, 0])

    def after(of: np.ndarray) -> float:
        """Largest mean change after a step, in its direction."""
        changes = [
            float(np.mean(rising * (of[edges + lag] - of[edges]))) for lag in range(1, _LAGS)
        ]
        return max(changes, key=abs)

    moved = after(samples.position[:, 0])
    found = [Compared(PUSH, None, moved, moved > 0, "the axis has to give way to it")]
    if axis.reports_force:
        acting = after(samples.force[:, 0]) / 2
        found.insert(0, Compared(OFFSET, asked, acting, 0.5 < acting / asked < 2.0))
    return found


def note_checked(machine: Machine, axis: str, moment: datetime) -> Path | None:
    """Keeps beside the machine file that an axis was checked; its path, None without a file.

    Raises:
        StagectlError: it cannot be written.
    """
    notes = _notes(machine)
    checked = moment.isoformat(timespec="seconds")
    notes.add({axis: {"checked": checked, **_units(machine, axis)}})
    return notes.path


def never_checked(machine: Machine) -> str | None:
    """One line on the axes that were not checked with the units that they have now, if any.

    Raises:
        UnusableInput: the note is damaged.
    """
    noted = _notes(machine).read(dict)
    axes = [x for x in machine.axes if not _units(machine, x).items() <= noted.get(x, {}).items()]
    if not axes:
        return None
    nodes = "; ".join(f"stagectl check {machine.axes[name].node} --move" for name in axes)
    return (
        f"axes {', '.join(axes)}: scale and sign were never checked by a move with these units; "
        f"they are by: {nodes}"
    )


def _units(machine: Machine, axis: str) -> dict[str, object]:
    drive = machine.axes[axis].drive
    units: dict[str, object] = {name: getattr(drive, name) for name in _UNITS}
    return {**units, "increment": machine.axes[axis].encoder.increment}


def _notes(machine: Machine) -> AxisNotes:
    return AxisNotes(machine.source, "checked")
