"""The observers of a stage's axes, stepped at every SYNC.

Source: docs/reference/observer.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.observer.design import Design
from estimation.observer.kernel import (
    FAILED,
    FRESH,
    OFF,
    RUNNING,
    USUAL,
    make_observers,
    make_state,
    step,
)
from estimation.observer.model import LACK
from estimation.observer.watch import (
    BLOCK,
    ELSEWHERE,
    FED,
    GROWS,
    OUT,
    SLOWEST,
    STANDS,
    SUSPECTED,
    UNANSWERED,
    WATCHING,
)
from stagedata import F64
from stagedata.compiled import machine_code

I64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class BusUnits:
    """Integers of an axis on the bus.

    Attributes:
        increment: one unit of positions [m].
        force: one unit of forces [N].
        peak_force: where the drive clamps its output [N].
    """

    increment: float
    force: float
    peak_force: float


JUMP = 2.0
"""Of the Coulomb force: within a period no force changes by more, all friction turned round."""
MASS_OFF = 0.3
"""Share of the mass that a correction may make up for."""
AT_REST = 5e-9
"""Largest deviation that a leak of the correction to the drive's integrator may cause [m]."""
UNWINDS = 0.1
"""Time constant in which the correction takes over what the drive's integrator holds too much,
while an axis moves [s]: that takes a deviation, which is gone when it arrives."""
OUT_LEAK = 0.5
"""Fastest leak of a correction that is out [N/s]."""
UNFORESEEN = 2.0
"""Standard deviations of a deviation around its prediction: what is more, and persists, is not the
disturbance that the model has."""
_SATURATED = 0.98
"""Of the peak force: the reading is rounded, and behind the output."""


class Kind(IntEnum):
    """What the watchdog has found."""

    SUSPECTED = SUSPECTED
    FED = FED
    ELSEWHERE = ELSEWHERE
    STANDS = STANDS
    UNANSWERED = UNANSWERED
    GROWS = GROWS


class Finding(NamedTuple):
    """One of the watchdog.

    Attributes:
        axis: its number.
        kind: of it.
        time: since the first row [s].
        rms: of the oscillation, or the deviation that stands [m].
        frequency: of the oscillation [Hz].
        correction: now [N].
    """

    axis: int
    kind: Kind
    time: float
    rms: float
    frequency: float
    correction: float


class StageObserver:
    """Corrects the force offsets of all axes.

    Args:
        designs: one per axis; None, or one without gain: offsets are sent as planned.
        units: of each axis.
        period: Ts [s].
        control_period: Tc [s].

    Attributes:
        sample: int64[n, 4], written by the caller before each row: position [increments], force
            [1/1000 rated], whether it is valid, arrival of its frame after SYNC [ns].
    """

    def __init__(
        self,
        designs: Sequence[Design | None],
        units: Sequence[BusUnits],
        period: float,
        control_period: float,
    ) -> None:
        count = len(designs)
        used = [None if d is None or d.gain == 0.0 else d for d in designs]
        states = max((len(d.model.gain) for d in used if d is not None), default=1)
        self.is_on = tuple(d is not None for d in used)
        self._observers = made = make_observers(count, states)
        axes = made.axes
        axes["increment"] = [unit.increment for unit in units]
        axes["unit"] = [unit.force for unit in units]
        axes["saturation"] = [_SATURATED * unit.peak_force / unit.force for unit in units]
        self._control_period = control_period
        axes["period"] = period * 1e9
        axes["usual_step"] = USUAL * period * 1e9
        for a, chosen in enumerate(used):
            if chosen is not None:
                self._set_figures(a, chosen)
        self._state = make_state(count, states)
        self.sample: I64 = np.zeros((count, 4), np.int64)
        self._told = [0] * count
        self._sent: I64 = np.zeros(count, np.int64)
        self._targets: I64 = np.zeros((0, count), np.int64)
        self._planned: F64 = np.zeros((0, count))
        self.restart()
        self._compile()

    def _set_figures(self, a: int, design: Design) -> None:
        """Those of axis `a` that its design decides."""
        made, model, size = self._observers, design.model, len(design.model.gain)
        made.transition[a, :size, :size] = model.transition
        made.vectors[a, :, :size] = model.ramp_from, model.ramp_to, model.kick
        made.steady[a, :size, :size] = model.covariance
        own = made.axes[a]
        sampled = self._control_period - design.figures.age
        own["first_tick"] = sampled / design.figures.period
        own["noise"], own["walk"] = design.figures.noise**2, design.walk**2
        own["jump"] = JUMP * design.figures.coulomb / abs(model.gain[LACK])
        own["limit"] = design.figures.limit
        own["correction_gain"] = design.gain / model.force_ratio
        own["kept"] = 1.0 - design.gain
        figures, period, constant = design.figures, design.figures.period, 1.0 / design.gain
        drive, unit = figures.drive, float(own["unit"])
        own["accelerated"] = MASS_OFF * figures.carriage.mass * float(own["increment"]) / period**2
        own["forgets"] = math.exp(-1.0 / (BLOCK * constant))
        own["unwinds"], own["ends"] = period / UNWINDS, math.ceil(BLOCK * constant)
        # the deviation at which the observer brings back what leaks
        own["most_leak"] = design.gain * (drive.kp + figures.carriage.stiffness) * AT_REST
        watching = made.watching[a]
        watching["high_pass"] = math.exp(-1.0 / (SLOWEST * constant))
        watching["block"] = math.ceil(BLOCK * constant)
        one_unit = unit / (drive.kp + figures.carriage.stiffness)
        watching["floor"] = max(one_unit, UNFORESEEN * model.spread) ** 2
        watching["kp"] = drive.kp
        self.bound(a, float(own["bound"]) or figures.coulomb)
        watching["out_leak"] = min(drive.ki * AT_REST, OUT_LEAK) * period

    def bound(self, axis: int, coulomb: float) -> None:
        """From now on the correction of an axis changes by this at most [N]; between two streams.

        In a move and the rest after it. Besides, 0.3 times the mass times the demanded
        acceleration is allowed.
        """
        if not self.is_on[axis]:
            return
        own = self._observers.axes[axis]
        own["bound"], own["leak"] = coulomb, float(own["most_leak"]) / coulomb
        watching = self._observers.watching[axis]
        taken_over = coulomb * float(own["unwinds"]) / (1.0 - float(own["kept"]))
        watching["stands"] = taken_over / watching["kp"]

    def _compile(self) -> None:
        """Compile the kernel, or load it, before anything moves."""
        axes = len(self.is_on)
        row, scratch = np.zeros((1, axes)), make_state(axes, self._state.rooms.shape[1])
        self._step = machine_code(
            step, self._observers, scratch, row.astype(np.int64), row, 0, 1, 0.0, self.sample,
            self._sent,
        )  # fmt: skip

    @property
    def correction(self) -> tuple[float, ...]:
        """Correction of each axis in effect, over the planned offsets [N]."""
        return tuple(self._state.axes["correction"].tolist())

    @property
    def failed(self) -> tuple[bool, ...]:
        """Which axes' estimates were not finite; their corrections stay as they are."""
        return tuple((self._state.axes["phase"] == FAILED).tolist())

    def restart(self) -> None:
        """The axes were without power: no correction, no estimate. What is out stays out."""
        watched = self._state.watched
        self._state = make_state(len(self.is_on), self._state.rooms.shape[1])
        for kept in ("clock", "findings", "finding", "found_at", "rms", "frequency", "known_power"):
            self._state.watched[kept] = watched[kept]
        self._state.watched["mode"] = np.where(watched["mode"] == OUT, OUT, WATCHING)
        self._state.axes["phase"] = np.where(self.is_on, FRESH, OFF)

    def findings(self) -> list[Finding]:
        """What the watchdog has found since this was last called, one per axis at most."""
        found = []
        for axis, watched in enumerate(self._state.watched):
            if watched["findings"] != self._told[axis]:
                self._told[axis] = watched["findings"]
                period = float(self._observers.axes[axis]["period"]) * 1e-9
                found.append(
                    Finding(
                        axis,
                        Kind(int(watched["finding"])),
                        float(watched["found_at"]) * period,
                        float(watched["rms"]),
                        float(watched["frequency"]) / period,
                        float(self._state.axes[axis]["correction"]),
                    )
                )
        return found

    @property
    def out(self) -> tuple[bool, ...]:
        """Which axes' corrections the watchdog has taken out."""
        return tuple((self._state.watched["mode"] == OUT).tolist())

    def redesign(self, axis: int, design: Design) -> None:
        """From now on observe an axis by another design of as many states, between two streams.

        Its correction stays, the estimate begins anew.
        """
        self._set_figures(axis, design)
        now = self._state.axes[axis]
        if now["phase"] == RUNNING:
            now["phase"] = FRESH

    def begin(self, targets: I64, planned: F64, target: Sequence[int], continued: bool) -> None:
        """Take the setpoints of a stream.

        Args:
            targets: int64[K, n] [increments].
            planned: force offsets, float64[K, n] [1/1000 rated].
            target: sent last [increments].
            continued: the last SYNC carried the last row of the stream before.
        """
        self._targets = np.ascontiguousarray(targets, np.int64)  # as compiled for
        self._planned = np.ascontiguousarray(planned, np.float64)
        axes = self._state.axes
        if len(targets):
            sets_off = (targets[0] != target).any() & (axes["target"] == axes["target_before"])
            axes["base"] = np.where(sets_off, axes["correction"], axes["base"])
        if not continued:
            axes["phase"][axes["phase"] != OFF] = FRESH
            axes["target"] = axes["target_before"] = target

    def offsets(self, row: int, periods: int, doubt: float) -> list[int]:
        """Force offsets to send with a row [1/1000 rated], after `sample` has been written.

        Args:
            row: of the stream.
            periods: from the SYNC of the row before the last one to that of the last one.
            doubt: how far that SYNC was off its place on the grid, over Ts.
        """
        self._step(
            self._observers, self._state, self._targets, self._planned, row, periods, doubt,
            self.sample, self._sent,
        )  # fmt: skip
        sent: list[int] = self._sent.tolist()
        return sent
