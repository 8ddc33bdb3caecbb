"""The plant stepped in control ticks: what the virtual drives work on.

When what is sampled: docs/reference/reference-stage.md, timing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hil_sim.plant.arrays import Arrays
from hil_sim.plant.control import HELD_AT_POSITION, SET_TO_ZERO
from hil_sim.plant.mechanics import step
from hil_sim.plant.noise import Noise
from hil_sim.settings import StageSettings
from stagedata.compiled import machine_code

_NOISE_BLOCK = 4096  # control ticks of noise drawn at once
_COUNTS, _FORCE, _VELOCITY = 0, 1, 3  # of a report


class Plant:
    """A `PlantPort`: all axes of the simulated stage, advanced in control ticks.

    Args:
        settings: of the stage.
        seed: of encoder noise and friction wander; None for neither.
        start: true position of each axis [m], at rest with all friction states zero; default 0.

    Attributes:
        time_ns: start of the next control tick to integrate.

    Raises:
        ValueError: effects are impossible; names axis and effect.
    """

    def __init__(
        self, settings: StageSettings, seed: int | None, start: Sequence[float] | None = None
    ) -> None:
        count = len(settings.axes)
        self.settings = settings
        self.time_ns = 0
        self._period = settings.control_period
        self._period_ns = round(self._period * 1e9)
        self._arrays = Arrays(settings, [0.0] * count if start is None else start)
        self._noise = Noise(count, seed)
        arrays = self._arrays
        arrays.state["wander"] = self._noise.draw_initial_wander(settings)
        self._normals = self._noise.draw(_NOISE_BLOCK)
        self._used = 0
        self._clock_runs = False
        # Commands wait for the next step; its report is kept as plain floats.
        self._orders = np.zeros((count, 5))
        self._order_rows: list[Any] = [row.data for row in self._orders]
        self._report = np.zeros((count, 5))
        self._report[:, 0] = np.round(arrays.state["encoder"] / arrays.plant["increment"])
        self._report[:, 2] = arrays.state["encoder"]
        self._values: list[list[float]] = self._report.tolist()
        self._before = self._after = self._values
        self._step: Callable[..., object] | None = None
        self._mechanics = arrays.mechanics

    def advance_to(self, time_ns: int) -> None:
        """Integrate all control ticks that start before `time_ns`; no effect for the past.

        Within a tick, measurements are interpolated between its ends, as if latched at SYNC.
        """
        left = self.time_ns - time_ns
        if left < 0:
            ticks = -(left // self._period_ns)
            left += ticks * self._period_ns
            if not left:
                self._integrate(ticks)
                return
            if ticks > 1:
                self._integrate(ticks - 1)
            before = self._after
            self._integrate(1)
            self._before, self._values = before, self._report.tolist()
        if 0 <= left < self._period_ns and self._before is not self._after:
            self._interpolate(left / self._period_ns)

    def _interpolate(self, left: float) -> None:
        """Interpolate measurements to the fraction `left` of a tick before its end."""
        for values, before, after in zip(self._values, self._before, self._after, strict=True):
            values[_COUNTS] = round(after[_COUNTS] + left * (before[_COUNTS] - after[_COUNTS]))
            for k in (_FORCE, _VELOCITY):
                values[k] = after[k] + left * (before[k] - after[k])

    def _integrate(self, ticks: int) -> None:
        self.time_ns += ticks * self._period_ns
        while ticks > 0:
            if self._used == _NOISE_BLOCK:
                self._normals = self._noise.draw(_NOISE_BLOCK)
                self._used = 0
            part = min(ticks, _NOISE_BLOCK - self._used)
            arguments = (
                self._mechanics, self._normals, self._used, part, self._orders, self._report,
            )  # fmt: skip
            if self._step is None:
                self._step = machine_code(step, *arguments)  # a first call
            else:
                self._step(*arguments)
            self._used += part
            ticks -= part
        self._values = self._before = self._after = self._report.tolist()

    def power(self, axis: int, on: bool) -> None:
        """Close the loop (demand := actual, integrator and offset := 0) or cut the force."""
        loop = self._arrays.loop[axis]
        reading = float(self._arrays.state[axis]["encoder"])
        for name in HELD_AT_POSITION:
            loop[name] = reading
        for name in SET_TO_ZERO:
            loop[name] = 0
        loop["powered"], loop["open"] = on, False
        self._orders[axis] = (0.0, 0.0, 0.0, 0.0, 1.0)
        self._values[axis][2] = reading
        self._values[axis][4] = 0.0

    def command(self, axis: int, position: float, force: float, ticks: int) -> None:
        """Ramp demand [m] and force offset [N] linearly to this pair, reached after `ticks`."""
        order = self._order_rows[axis]
        order[0], order[1], order[2], order[3] = 1.0, position, force, ticks

    def open_loop(self, axis: int) -> None:
        """Command the force alone, until `power` closes the loop again."""
        self._arrays.loop[axis]["open"] = True

    def start_clock(self) -> None:
        """Set t = 0 for effects that depend on time; once after power-on, for all axes."""
        if not self._clock_runs:
            self._clock_runs = True
            self._arrays.state["clock"] = 0

    def encoder(self, axis: int) -> int:
        """Encoder counts at the time advanced to, from true zero."""
        return int(self._values[axis][0])

    def force(self, axis: int) -> float:
        """Measured motor force at that time [N]."""
        return self._values[axis][1]

    def demand(self, axis: int) -> float:
        """Position demand inside the drive [m]."""
        return self._values[axis][2]

    def velocity(self, axis: int) -> float:
        """Low-passed encoder velocity at that time [m/s]."""
        return self._values[axis][3]

    def following_error(self, axis: int) -> float:
        """Largest |demand - encoder| [m] since the last call."""
        values = self._values[axis]
        worst, values[4] = values[4], 0.0
        self._order_rows[axis][4] = 1.0
        return worst


def warm_up(settings: StageSettings) -> None:
    """Compile (or load from the cache) what a `Plant` needs, before real time begins."""
    plant = Plant(settings, None)
    plant.power(0, True)
    plant.command(0, 0.0, 0.0, settings.ticks)
    plant.advance_to(1)
