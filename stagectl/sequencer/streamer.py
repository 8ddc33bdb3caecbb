"""Streams setpoints to the stage, keeps what comes back, and watches the following error.

A drive compares its position with the demand it has (0x6065, 0x6066). It cannot notice that the
host's setpoints no longer reach it, or that its position no longer reaches the host: this can.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from estimation.trajectory import Limits
from stagectl.errors import RunFault
from stagectl.sequencer.compensation.known_axis import REST_SAMPLES, SAMPLES_BEFORE_MOVE
from stagectl.sequencer.samples.sample_validity import mean_force, without_late
from stagedata import F64, Samples

Until = Callable[[tuple[float, ...]], bool]

FAULT_SAMPLES = 10
"""Samples outside the window of the following error, within one block, that make a fault."""


class StagePort(Protocol):
    """What the sequencer needs of a stage enabled in csp."""

    @property
    def targets(self) -> tuple[float, ...]:
        """Target positions sent last [m]."""

    @property
    def streams(self) -> bool:
        """Whether the drives follow setpoints; else they move by their own profiles (pp)."""

    def stream(self, position: F64, offset: F64, until: Until | None = None) -> Samples:
        """Send one setpoint pair per SYNC, [m] and [N], shape (K, n); `until` ends it early."""

    def stream_to(
        self,
        targets: Sequence[float],
        velocity: Sequence[float],
        acceleration: Sequence[float],
        until: Until | None = None,
    ) -> Samples:
        """Move by the drives' own profiles, [m], [m/s], [m/s^2]; `until` ends it early."""


class Streamer:
    """Between the moves and the stage.

    Args:
        stage: enabled in csp, at rest.
        names: of the axes, in the order of all arrays.
        windows: of the host's own watch over the following error, per axis [m].
        period: Ts [s].
        stop: asked on every SYNC; True ends what is being streamed.

    Attributes:
        samples: SYNCs streamed so far, which is the index of the next sample.
        rest_force: measured at rest before the move under way [N], shape (n,).
    """

    def __init__(
        self,
        stage: StagePort,
        names: Sequence[str],
        windows: Sequence[float],
        period: float,
        stop: Callable[[], bool],
    ) -> None:
        self._stage, self._names, self._windows = stage, names, windows
        self._period, self._stop = period, stop
        self.restart(0)

    def restart(self, samples: int) -> None:
        """Begin again with the stage enabled and at rest, after this many samples."""
        count = len(self._names)
        self.samples = samples
        self.rest_force: F64 = np.zeros(count)
        self._latest = Samples.missing(0, count)
        self._at_rest = 0
        self._blocks = [self._latest]
        self._planned: list[F64] = []

    @property
    def time(self) -> float:
        """Time of the next SYNC if it is punctual [s]."""
        return float(self._latest.time[-1]) + self._period if len(self._latest) else 0.0

    @property
    def has_record(self) -> bool:
        """Whether anything has been streamed since the move under way began."""
        return bool(self._planned)

    def begin_move(self) -> None:
        """From here on the samples are those of a move, after the last few at rest."""
        if len(self._latest):
            self.rest_force = mean_force(self._latest)
        before = self._latest.tail(SAMPLES_BEFORE_MOVE)
        self._at_rest = len(before)
        self._blocks, self._planned = [before], []

    def record(self) -> Samples:
        """What has come back of the move so far, the samples at rest before it included."""
        self._blocks = [Samples.concatenate(self._blocks)]
        return self._blocks[0]

    def streamed(self) -> tuple[Samples, F64]:
        """The samples since the move began, and the force offsets as planned [N], shape (K, n)."""
        record = self.record()
        return record.tail(len(record) - self._at_rest), np.concatenate(self._planned)

    def stream(self, demand: F64, offset: F64, until: Until | None = None) -> int:
        """Send setpoints and keep the samples; return how many went.

        Args:
            demand: positions [m], shape (K, n).
            offset: force offsets [N], shape (K, n).
            until: called with the measured positions [m] after each SYNC; True ends it.

        Raises:
            RunFault: an axis has left its window.
        """
        stop = self._stop
        if until is None:
            return self._send(demand, offset, lambda _: stop())
        return self._send(demand, offset, lambda position: until(position) or stop())

    def stream_to(self, targets: Sequence[float], limits: Sequence[Limits]) -> bool:
        """Move all axes to their targets by their drives' own profiles, and keep the samples.

        The drives watch the following error: their demand is not known here.

        Args:
            targets: [m].
            limits: of each axis' profile.

        Returns:
            False where a stop was asked for: the axes are then at rest on the way.
        """
        stopped = False

        def until(_: tuple[float, ...]) -> bool:
            nonlocal stopped
            stopped = self._stop()
            return stopped

        speeds, rates = [of.velocity for of in limits], [of.acceleration for of in limits]
        samples = without_late(self._stage.stream_to(targets, speeds, rates, until))
        self._keep(samples, np.zeros((len(samples), len(self._names))))
        return not stopped

    def stream_to_rest(self, demand: F64, offset: F64) -> None:
        """The same to the end, whoever asks for a stop meanwhile."""
        self._send(demand, offset, lambda _: False)

    def _send(self, demand: F64, offset: F64, until: Until) -> int:
        samples = without_late(self._stage.stream(demand, offset, until))
        self._keep(samples, offset[: len(samples)].copy())
        check_following_error(samples, demand, self._names, self._windows)
        return len(samples)

    def _keep(self, samples: Samples, planned: F64) -> None:
        self._blocks.append(samples)
        self._planned.append(planned)
        self.samples += len(samples)
        latest = samples
        if len(samples) < REST_SAMPLES:
            latest = Samples.concatenate([self._latest, samples])
        self._latest = latest.tail(REST_SAMPLES)


def check_following_error(
    samples: Samples, demand: F64, names: Sequence[str], windows: Sequence[float]
) -> None:
    """Compare position k with demand k - 1, where the drive was when it sampled.

    Args:
        samples: of one block of setpoints, shape (K, n).
        demand: the setpoints [m], shape (K or more, n).
        names: of the axes.
        windows: largest following error of each axis [m].

    Raises:
        RunFault: an axis has left its window in FAULT_SAMPLES valid samples.
    """
    error = np.abs(samples.position[1:] - demand[: len(samples) - 1])
    outside = (error > windows) & samples.valid[1:]
    for a in np.flatnonzero(outside.sum(axis=0) >= FAULT_SAMPLES).tolist():
        farthest = error[outside[:, a], a].max()
        raise RunFault(
            f"axis {names[a]}: 0x6064:00 position actual: {farthest * 1e3:.3g} mm from the "
            f"demand (following_error: {windows[a] * 1e3:g} mm); do setpoints reach the drive?"
        )
