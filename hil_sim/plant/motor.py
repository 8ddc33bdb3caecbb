"""One axis of the plant in the drive's integer units, forces in 1/1000 of the rated force.

The incremental encoder counts from 0 where it was powered on; `origin` is the true counter value at
position actual value 0 and is set by homing. Positions of commands are added as integers, so that a
target reaches the loop as exactly that many units.

Source: docs/reference/reference-stage.md, the drive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil_sim.ports import PlantPort
from hil_sim.quirks import OddOffset
from hil_sim.settings import AxisSettings, StageSettings

I64 = NDArray[np.int64]


def _int32(value: float) -> int:
    return max(-(1 << 31), min((1 << 31) - 1, round(value)))


class Motor:
    """Encoder, force and demand of one axis.

    Attributes:
        settings: of the axis.
        unit, speed_unit, rate_unit: one unit of position, velocity, acceleration [m, m/s, m/s^2].
        tick_ns: control period [ns].
        open: the force alone is commanded.
        origin: true counter value at position 0 [increments].
    """

    def __init__(self, plant: PlantPort, axis: int, stage: StageSettings) -> None:
        self.settings: AxisSettings = stage.axes[axis]
        self.unit = self.settings.unit
        self.speed_unit = self.settings.velocity_unit
        self.rate_unit = self.settings.acceleration_unit
        self.tick_ns = round(stage.control_period * 1e9)
        self._plant = plant
        self._axis = axis
        self._scale = self.settings.increment / self.unit
        self._whole = round(self._scale) if abs(self._scale - round(self._scale)) < 1e-9 else None
        habits = self.settings.habits
        self._permille = self.settings.control.rated_force / 1000.0 * habits.force_factor
        self._interpolates = habits.interpolates
        self.origin = plant.encoder(axis)
        self.open = False
        self._clock_started = False
        self._ready = False  # the clock runs, and the loop is closed
        quirks = self.settings.quirks
        self._odd = None if quirks is None else OddOffset(quirks)

    def counter(self) -> int:
        """True encoder counter [increments], 0 at the index mark."""
        return self._plant.encoder(self._axis)

    def position(self) -> int:
        """Position actual value [units], INTEGER32."""
        return self.to_position(self._plant.encoder(self._axis))

    def to_position(self, counter: int) -> int:
        """Position actual value [units] of a true encoder counter, INTEGER32."""
        counts, whole = counter - self.origin, self._whole
        value = counts * whole if whole else round(counts * self._scale)
        return value if -0x80000000 <= value <= 0x7FFFFFFF else _int32(value)

    def velocity(self) -> int:
        """Velocity actual value [velocity units], INTEGER32."""
        return _int32(self._plant.velocity(self._axis) / self.speed_unit)

    def force(self) -> int:
        """Torque actual value [1/1000 of the rated force], INTEGER16."""
        value = round(self._plant.force(self._axis) / self._permille)
        return value if -32768 <= value <= 32767 else 32767 if value > 0 else -32768

    def demand(self) -> float:
        """Position demand inside the loop, true coordinate [m]."""
        return self._plant.demand(self._axis)

    def worst_following_error(self) -> float:
        """Largest following error since this was last called [units]."""
        return self._plant.following_error(self._axis) / self.unit

    def to_true(self, position: int) -> float:
        """Convert a position of the drive [units] to a true coordinate [m]."""
        if self._whole:
            return (position + self.origin * self._whole) * self.unit
        return position * self.unit + self.origin * self.settings.increment

    def to_drive(self, position: float) -> int:
        """Convert a true coordinate [m] to a position of the drive [units], INTEGER32."""
        return _int32((position - self.origin * self.settings.increment) / self.unit)

    def power(self, on: bool) -> None:
        """Close the loop at the present position, or take the force off."""
        self._plant.power(self._axis, on)
        if self._odd is not None:
            self._odd.clear()
        self.open = False
        self._ready = self._clock_started

    def command(self, position: int, permille: int, ticks: int) -> None:
        """Ramp to a target [units] and force offset [1/1000 rated] within `ticks` control ticks.

        A drive that does not interpolate is there at the next tick.
        """
        if not self._interpolates:
            ticks = 1
        if not self._ready:
            self._begin_streaming()
        whole = self._whole
        true = (position + self.origin * whole) * self.unit if whole else self.to_true(position)
        acting = permille if self._odd is None else self._odd.take(permille)
        self._plant.command(self._axis, true, acting * self._permille, ticks)

    def _begin_streaming(self) -> None:
        if not self._clock_started:
            self._clock_started = True
            self._plant.start_clock()
        if self.open:
            self.power(True)
        self._ready = True

    def command_true(self, position: float, ticks: int) -> None:
        """Ramp to a true coordinate [m] within `ticks` control ticks, force offset 0."""
        if self.open:
            self.power(True)
        self._plant.command(self._axis, position, 0.0, ticks)

    def command_force(self, permille: int) -> None:
        """Open the loop and command this force [1/1000 rated] from the next control tick on."""
        if not self.open:
            self.open = True
            self._ready = False
            self._plant.open_loop(self._axis)
        self._plant.command(self._axis, self.demand(), permille * self._permille, 1)
