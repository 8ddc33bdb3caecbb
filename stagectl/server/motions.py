"""What the stage does on request, besides runs: enable, home, move, jog; measurements and checks.

All of it in the stage's thread. Moves are setpoints in csp where the drives have it, so that they
are sampled as a run is; else the drive's own profile (pp).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from drivers.canopen import LISTENING, Network, open_bus
from drivers.commissioning.conformance import run as check_conformance
from drivers.settings import AxisSettings, BusSettings
from drivers.stage import Stage
from estimation.trajectory import Limits, plan
from stagectl.config.machine import Machine
from stagectl.errors import Aborted, UnusableInput
from stagectl.measurement import check_scale, measure_stage
from stagectl.run.retries import acknowledge_faults
from stagectl.server.handover import Handover
from stagedata import F64

VELOCITY, ACCELERATION = 10e-3, 1.0
"""Of a move, reduced to the axis' limits [m/s, m/s^2]."""
JOG_MOST = 50e-3
"""Largest velocity of a jog [m/s]."""
LEASE = 0.2
"""How long a jog goes on without being renewed [s]."""
_JOG_BLOCK = 0.01  # setpoints of a jog are made for this long ahead [s]
_REST = 0.1  # held after a move [s]


@dataclass(slots=True)
class JogDemand:
    """Where a jog is to go; written by the thread that hears the client, read by the stage's.

    Attributes:
        velocity: wanted [m/s].
        renewed: when it was last asked for, on the monotonic clock [s].
    """

    velocity: float
    renewed: float

    def wanted(self) -> float:
        """The velocity wanted now [m/s]: 0 where nobody renews it."""
        return self.velocity if time.monotonic() - self.renewed <= LEASE else 0.0


class Motions:
    """The motions of one stage.

    Args:
        machine: whose file has the masses.
        phase: called with a few words as a motion proceeds.
    """

    def __init__(self, machine: Machine, phase: Callable[[str], object]) -> None:
        self._masses = {name: axis.plant.mass for name, axis in machine.axes.items()}
        self._phase = phase

    def enable(self, stage: Stage, reset: bool) -> None:
        """Enable all axes where they are."""
        if reset:
            acknowledge_faults(stage, self._phase)
        self._phase("enabling the drives")
        stage.enable()

    def home(self, stage: Stage, force: bool, reset: bool) -> None:
        """Home the axes and hold them."""
        if reset:
            acknowledge_faults(stage, self._phase)
        self._phase("homing")
        stage.home(force)
        self._phase("enabling the drives")
        stage.enable()

    def move(
        self, stage: Stage, axis: str, position: float | None, distance: float, velocity: float
    ) -> dict[str, float]:
        """Move an axis to a position, or by a distance where that is None [m]; it ends held.

        Raises:
            UnusableInput: it is not homed, or the target is outside its travel.
        """
        column = self._column(stage, axis)
        stage.enable()
        start = stage.targets[column]
        target = start + distance if position is None else position
        settings = stage.axes[column].settings
        low, high = settings.travel
        if not low <= target <= high:
            raise UnusableInput(
                f"axis {axis}: target {target:.6g} m is outside its travel {low:g}..{high:g} m"
            )
        acceleration = min(ACCELERATION, settings.acceleration)
        self._phase(f"moving {axis} to {target * 1e3:.6g} mm")
        if not stage.streams:
            stage.move_to(axis, target, velocity, acceleration)
        else:
            self._stream_move(stage, column, target, Limits(velocity, acceleration, settings.jerk))
        stage.hold(_REST)
        return {"position": stage.positions[column], "start": start}

    def _stream_move(self, stage: Stage, column: int, target: float, limits: Limits) -> None:
        period, increment = stage.settings.sync_period, stage.axes[column].increment
        begin = np.array(stage.targets)
        end = round(target / increment) * increment
        planned = plan(float(begin[column]), end, limits)
        at: F64 = np.arange(1.0, int(planned.duration / period) + 2) * np.float64(period)
        position, _, acceleration = planned.sample(at)
        rows = np.tile(begin, (len(at), 1))
        rows[:, column] = position
        rows[-1, column] = end
        force = np.tile(stage.offsets, (len(at), 1))
        force[:, column] = self._masses[stage.axes[column].name] * acceleration
        stage.stream(rows, force)

    def jog(self, stage: Stage, axis: str, demand: JogDemand) -> dict[str, float]:
        """Move an axis at the velocity wanted until nobody wants it any more, then hold it.

        Raises:
            UnusableInput: it is not homed.
        """
        column = self._column(stage, axis)
        stage.enable()
        stage.require_csp()
        self._phase(f"jogging {axis}")
        settings, period = stage.axes[column].settings, stage.settings.sync_period
        steps = max(1, round(_JOG_BLOCK / period))
        slope = min(ACCELERATION, settings.acceleration)
        start, velocity = stage.targets[column], 0.0
        position = start
        while True:
            wanted = demand.wanted()
            if not wanted and not velocity:
                break
            block = np.empty(steps)
            for k in range(steps):
                allowed = allowed_velocity(position, wanted, slope, settings.travel, period)
                velocity += float(np.clip(allowed - velocity, -slope * period, slope * period))
                position += velocity * period
                block[k] = position
            rows = np.tile(stage.targets, (steps, 1))
            rows[:, column] = block
            stage.stream(rows, np.zeros_like(rows))
        stage.hold(_REST)
        return {"position": stage.positions[column], "start": start}

    def _column(self, stage: Stage, axis: str) -> int:
        column = [each.name for each in stage.axes].index(axis)
        if not stage.axes[column].homed:
            raise UnusableInput(f"axis {axis} is not homed: its travel limits count from its zero")
        return column


def allowed_velocity(
    position: float, wanted: float, slope: float, travel: tuple[float, float], period: float
) -> float:
    """The velocity wanted, as far as the axis can still stop within its travel [m/s]."""
    left = (travel[1] - position) if wanted > 0 else (position - travel[0])
    most = max(0.0, (2 * slope * max(0.0, left)) ** 0.5 - slope * period)
    return float(np.clip(wanted, -most, most))


def checked_velocity(asked: float | None, most: float, axis: str) -> float:
    """The velocity of a move [m/s].

    Raises:
        UnusableInput: it is above the axis' limit.
    """
    velocity = min(VELOCITY, most) if asked is None else asked
    if not 0 < velocity <= most:
        raise UnusableInput(f"axis {axis}: velocity must be in (0, {most:g}] m/s, is {velocity:g}")
    return velocity


def measure(stage: Stage, machine: Machine, simulated: bool, agreed: bool) -> dict[str, Any]:
    """Home the stage, measure how its axes respond, and hold it.

    Args:
        stage: booted.
        machine: as the host believes it.
        simulated: on virtual drives, whose measurement has no date.
        agreed: else it is only said what the axes will do.

    Returns:
        `does`: lines of what each axis will do; or `measurement`: text of a response file.
    """
    lines: list[str] = []

    def ask(does: list[str]) -> bool:
        lines.extend(does)
        return agreed

    stage.require_csp()
    stage.home()
    stage.enable()
    now = None if simulated else datetime.now(UTC).astimezone()
    try:
        return {"measurement": measure_stage(stage, machine, now, ask).as_text()}
    except Aborted:
        if agreed:
            raise
        return {"does": lines}


def check_drive(
    bus: BusSettings, handover: Handover, node: int, power: bool, homing: bool
) -> dict[str, Any]:
    """Test a drive against CiA 301 and CiA 402, on a bus that nothing else uses.

    Returns:
        `found`: the findings, as dictionaries.
    """
    opened = open_bus(bus)
    try:
        network = Network(opened, str(bus), handover.frame, beats=False)
        network.watchers.append(lambda _: handover.stop.check())
        network.listen(LISTENING)  # refuses a bus on which another host is active
        findings = check_conformance(network, node, power=power, homing=homing)
        network.disconnect()
    finally:
        opened.shutdown()
    return {"found": [{**asdict(each), "verdict": str(each.verdict)} for each in findings]}


def check_move(
    bus: BusSettings, handover: Handover, axis: AxisSettings, machine: Machine
) -> dict[str, Any]:
    """Move an axis by 0.1 mm and back, and compare scale and sign with what was asked.

    Returns:
        `found`: what was compared, as dictionaries.
    """
    with Stage.open(bus, (axis,), tap=handover.frame) as stage:
        stage.interrupt = handover.stop.check
        stage.boot()
        compared = check_scale(stage, stage.axes[0], machine)
        stage.disable()
    return {"found": [asdict(each) for each in compared]}
