"""Shakes an enabled stage at rest and while it slides, within limits that are stated before.

The axes start and end where they stand. Whatever exceeds a limit ends the measurement with the axes
braked; what a drive reports is handled as in any other motion.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from drivers import Stage
from estimation.response import (
    AxisResponse,
    Excitation,
    FrequencyResponse,
    Shaken,
    evaluate,
    make_excitation,
)
from stagectl.config.machine import Axis, Machine
from stagectl.config.settings.host_model import drive_loop
from stagectl.errors import Aborted, RunFault, UnusableInput
from stagedata import F64, Samples

AT_REST, SLIDING = 0.1, 0.3
"""Peak of the force offset, over the Coulomb force: few elements slip, and none reverses."""
SPEED = 5e-3
"""While sliding [m/s]."""
PEAK_SPEED = 3.0
"""Speed allowed, over that while sliding: a badly damped axis swings."""
SPAN = 10
"""SYNCs over which speed is taken: one that is missed is no jump."""
FORCE = 0.5
"""Motor force allowed, over the drive's peak force."""
ERROR = 0.5
"""Following error allowed, over the axis' window."""
KEPT_PERIODS = 2
"""Periods of the excitation that are evaluated; one before is for the transient."""
RAMP = 0.2
"""Time in which speed and excitation rise and fall [s]."""
REST = 0.3
"""Time at rest before the first period [s]."""
LEAST_VALID = 0.99
"""Share of samples that have to be there; what is interpolated adds to the scatter."""
MARGIN = 1e-3
"""Distance kept from the ends of the travel [m]."""


@dataclass(frozen=True, slots=True)
class AxisBounds:
    """What the measurement does to an axis at most, and beyond which it ends.

    Attributes:
        name: of the axis.
        offset: force offset [N].
        force: motor force, as measured [N].
        speed: as measured [m/s].
        error: following error [m].
        low, high: range of its demand [m].
    """

    name: str
    offset: float
    force: float
    speed: float
    error: float
    low: float
    high: float

    def describe(self, rotary: bool = False) -> str:
        """One line for the operator."""
        m, n = ("rad", "N m") if rotary else ("m", "N")
        return (
            f"{self.name}: from {self.low * 1e3:.3f} to {self.high * 1e3:.3f} m{m} at up to "
            f"{self.speed * 1e3:.3g} m{m}/s, force offsets up to {self.offset:.2g} {n}; ends above "
            f"{self.force:.3g} {n} of motor force or {self.error * 1e6:.3g} u{m} of following error"
        )


class Experiment:
    """The measurement of a stage, planned from where it stands.

    Args:
        machine: as the host believes it.
        position: of each axis now [m], (n,).
        offers_offset: whether its drive takes force offsets.

    Attributes:
        names: of the axes that are measured: those that can have an observer.
        bounds: of each of them.
        duration: of the whole measurement [s].

    Raises:
        UnusableInput: there is no room to slide, or no axis that could be measured.
    """

    def __init__(
        self,
        machine: Machine,
        position: Sequence[float],
        offers_offset: Sequence[bool],
    ) -> None:
        self._period = machine.bus.sync_period
        axes = list(machine.axes.items())
        self._columns = [
            a
            for a, (_, axis) in enumerate(axes)
            if offers_offset[a] and axis.observer != "none" and drive_loop(axis.drive) is not None
        ]
        if not self._columns:
            raise UnusableInput(
                f"{machine.source}: axes: none can be measured: each is a cascade, has "
                "`observer: none`, or a drive without force offset (0x60B2)"
            )
        self._width, self._start = len(axes), np.array(position, np.float64)
        measured = [axes[a] for a in self._columns]
        self.names = tuple(name for name, _ in measured)
        self._gentle = _excitation([axis for _, axis in measured], AT_REST, self._period)
        self._strong = _excitation([axis for _, axis in measured], SLIDING, self._period)
        speeds = [min(SPEED, axis.limits.velocity / PEAK_SPEED) for _, axis in measured]
        self._path = self._slide(speeds)
        self._direct([axis for _, axis in measured], [name for name, _ in measured], machine)
        self.bounds = tuple(
            self._bounds(k, name, axis, speed)
            for k, ((name, axis), speed) in enumerate(zip(measured, speeds, strict=True))
        )

    @property
    def duration(self) -> float:
        """Of the measurement [s]."""
        at_rest = round(REST / self._period) + 2 * self._lead()
        rows = at_rest + (1 + KEPT_PERIODS) * len(self._gentle) + 2 * len(self._path)
        return rows * self._period

    def run(
        self,
        stage: Stage,
        stop: Callable[[], bool] = lambda: False,
        progress: Callable[[float], object] = lambda _: None,
    ) -> dict[str, AxisResponse]:
        """Shake the stage and evaluate its responses.

        Args:
            stage: enabled in csp, at rest where it was planned for, without a correction.
            stop: asked at every SYNC; True ends the measurement.
            progress: called with the share that is done.

        Returns:
            Axis -> responses at rest and while sliding.

        Raises:
            RunFault: a limit was exceeded, or too many samples are missing.
            Aborted: it was stopped.
            DriverError: from the stage.
        """
        watch = _Watch(
            stage, self._columns, self.bounds, self._period, self.duration, stop, progress
        )
        still = np.tile(self._start, (round(REST / self._period), 1))
        watch.stream(still, np.zeros_like(still))
        rows = 2 * self._lead() + (1 + KEPT_PERIODS) * len(self._gentle)
        nowhere = np.zeros((rows, len(self._columns)))
        rest = [(nowhere, self._stream(watch, nowhere, self._gentle))]
        passes = (self._path, self._path[-1] - self._path)  # there and back
        sliding = [(path, self._stream(watch, path, self._strong)) for path in passes]
        return {
            name: AxisResponse(
                self._evaluate(k, rest, self._gentle), self._evaluate(k, sliding, self._strong)
            )
            for k, name in enumerate(self.names)
        }

    def _lead(self) -> int:
        """Rows in which the speed rises."""
        return round(RAMP / self._period)

    def _slide(self, speeds: Sequence[float]) -> F64:
        """Displacement of the way there without shaking, (K, n)."""
        lead = self._lead()
        rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, lead + 1) / (lead + 1))
        even = np.ones((1 + KEPT_PERIODS) * len(self._strong))
        velocity = np.concatenate((rise, even, rise[::-1]))
        return np.outer(np.cumsum(velocity) * self._period, speeds)

    def _direct(self, axes: Sequence[Axis], names: Sequence[str], machine: Machine) -> None:
        """Let each axis slide to where there is room."""
        for k, (axis, name) in enumerate(zip(axes, names, strict=True)):
            at, way = self._start[self._columns[k]], self._path[-1, k]
            low, high = axis.travel[0] + MARGIN, axis.travel[1] - MARGIN
            if at + way > high:
                if at - way < low:
                    raise UnusableInput(
                        f"{machine.source}: axes.{name}.travel: the measurement slides by "
                        f"{way * 1e3:.1f} mm; from {at * 1e3:.1f} mm there is no room for it"
                    )
                self._path[:, k] *= -1.0

    def _bounds(self, k: int, name: str, axis: Axis, speed: float) -> AxisBounds:
        start = self._start[self._columns[k]]
        shaken = max(float(np.abs(e.demand[:, k]).max()) for e in (self._gentle, self._strong))
        path = self._path[:, k]
        return AxisBounds(
            name,
            float(np.abs(self._strong.offset[:, k]).max()),
            FORCE * axis.drive.peak_force,
            PEAK_SPEED * speed,
            ERROR * axis.limits.following_error,
            float(start + path.min() - shaken),
            float(start + path.max() + shaken),
        )

    def _stream(self, watch: _Watch, path: F64, excitation: Excitation) -> Samples:
        """Stream a path with an excitation that rises at its start and falls at its end."""
        rows, lead = len(path), self._lead()
        envelope = np.ones(rows)
        envelope[:lead] = 0.5 - 0.5 * np.cos(np.pi * np.arange(lead) / lead)
        envelope[-lead:] = envelope[lead - 1 :: -1]
        phase = np.arange(rows) % len(excitation)
        demand, offset = np.tile(self._start, (rows, 1)), np.zeros((rows, self._width))
        demand[:, self._columns] += path + envelope[:, None] * excitation.demand[phase]
        offset[:, self._columns] = envelope[:, None] * excitation.offset[phase]
        return watch.stream(demand, offset)

    def _evaluate(
        self, k: int, passes: Sequence[tuple[F64, Samples]], excitation: Excitation
    ) -> FrequencyResponse:
        """The responses of an axis from the periods in which path and excitation are even."""
        column, length = self._columns[k], len(excitation)
        first = self._lead() + length
        rows = first + np.arange(KEPT_PERIODS * length).reshape(KEPT_PERIODS, length)
        position, demand, offset = [], [], []
        for path, samples in passes:
            valid = samples.valid[:, column]
            if valid[rows].mean() < LEAST_VALID:
                raise RunFault(f"axis {self.names[k]}: too many samples are missing to measure it")
            moved = self._start[column] + path[:, k]
            at = np.arange(len(path))
            seen = np.interp(at, at[valid], samples.position[valid, column])
            position.append(_without_drift((seen - moved)[rows]))
            demand.append((samples.position_demand[:, column] - moved)[rows])
            offset.append(samples.force_offset[rows, column])
        return evaluate(
            np.concatenate(position),
            np.concatenate(demand),
            np.concatenate(offset),
            (excitation.offset_lines[k], excitation.demand_lines[k], excitation.empty_lines),
            self._period,
        )


def _without_drift(periods: F64) -> F64:
    """Periods (P, N) without the slope from one to the next, which a slow integrator leaves."""
    length = periods.shape[1]
    slope = float(np.mean(periods[-1] - periods[0])) / (len(periods) - 1) / length
    rows = np.arange(periods.size).reshape(periods.shape)
    drifted: F64 = periods - slope * (rows - rows.mean())
    return drifted


def _excitation(axes: Sequence[Axis], share: float, period: float) -> Excitation:
    shaken = []
    for axis in axes:
        loop = drive_loop(axis.drive)
        if loop is None:
            raise ValueError("a cascade is not shaken")
        force = share * axis.plant.friction.figures.coulomb
        shaken.append(Shaken(force, loop.kp, loop.ki, loop.kd, loop.derivative_time))
    return make_excitation(shaken, period)


class _Watch:
    """Streams, and ends the stream where a limit is exceeded."""

    def __init__(
        self,
        stage: Stage,
        columns: Sequence[int],
        bounds: Sequence[AxisBounds],
        period: float,
        duration: float,
        stop: Callable[[], bool],
        progress: Callable[[float], object],
    ) -> None:
        self._stage, self._period = stage, period
        self._limits = list(zip(columns, bounds, strict=True))
        self._stop, self._stopped = stop, False
        self._progress, self._rows, self._done = progress, duration / period, 0
        self._recent: deque[tuple[float, ...]] = deque(maxlen=SPAN)
        self._exceeded: str | None = None

    def stream(self, demand: F64, offset: F64) -> Samples:
        """Stream setpoints.

        Raises:
            RunFault: a limit was exceeded; the stage is to be stopped.
            Aborted: it was stopped.
        """
        row = 0

        def exceeds(position: tuple[float, ...]) -> bool:
            nonlocal row
            before = self._recent[0] if len(self._recent) == SPAN else position
            self._recent.append(position)
            target, row = demand[row], row + 1
            force = self._stage.forces
            for column, limit in self._limits:
                error = abs(position[column] - target[column])
                speed = abs(position[column] - before[column]) / (SPAN * self._period)
                self._exceeded = _reason(limit, error, speed, abs(force[column]))
                if self._exceeded is not None:
                    return True
            if self._stop():
                self._stopped = True
                return True
            self._done += 1
            if self._done % 256 == 0:
                self._progress(min(self._done / self._rows, 1.0))
            return False

        samples = self._stage.stream(demand, offset, exceeds)
        if self._exceeded is not None:
            raise RunFault(f"the measurement was ended: {self._exceeded}")
        if self._stopped:
            raise Aborted("the measurement was stopped by the operator")
        return samples


def _reason(limit: AxisBounds, error: float, speed: float, force: float) -> str | None:
    if error > limit.error:
        return f"axis {limit.name}: following error above {limit.error * 1e6:.3g} um"
    if speed > limit.speed:
        return f"axis {limit.name}: faster than {limit.speed * 1e3:.3g} mm/s"
    if force > limit.force:
        return f"axis {limit.name}: motor force above {limit.force:.3g} N"
    return None
