"""What the stage does on request, besides runs: enable, home, move, jog, disable.

All of it in the stage's thread. Moves are setpoints in csp where the drives have it, so that they
are sampled as a run is; else the drive's own profile (pp).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.stage import Stage
from estimation.trajectory import Limits, plan
from stagectl.config.machine import Machine
from stagectl.errors import UnusableInput
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
        self._make_reachable(stage, reset)
        self._phase("enabling the drives")
        stage.enable()

    def home(self, stage: Stage, force: bool, reset: bool) -> None:
        """Home the axes and hold them."""
        self._make_reachable(stage, reset)
        self._phase("homing")
        stage.home(force)
        self._phase("enabling the drives")
        stage.enable()

    def disable(self, stage: Stage) -> None:
        """Switch all axes off."""
        stage.disable()

    def _make_reachable(self, stage: Stage, reset: bool) -> None:
        """Acknowledge faults, and boot drives that have restarted since."""
        from drivers.errors import BusError, DriverError

        if not reset:
            return
        self._phase("acknowledging faults")
        try:
            stage.reset_faults()
        except BusError:
            raise
        except DriverError:
            self._phase("booting the drives")
            stage.boot()

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
