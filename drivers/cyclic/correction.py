"""Force offsets corrected from SYNC to SYNC, by what the last sample has shown.

The application chooses each row's offsets after the sample before it. Whatever goes wrong there
does not stop the stream: the last correction stays in effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.cyclic.channel import Channel
from drivers.cyclic.sync_producer import Exchange, Frames

_LEAST, _MOST = -32768, 32767

Row = tuple[Frames, Sequence[tuple[Channel, int, int]]]
"""Of a stream: each channel with its RPDO, and each channel with its target and offset."""


class OffsetCorrection(Protocol):
    """Chooses the force offsets of a stream, row by row; called in the thread that sends SYNC."""

    def begin(
        self,
        targets: NDArray[np.int64],
        planned: NDArray[np.float64],
        target: Sequence[int],
        continued: bool,
    ) -> None:
        """Take the setpoints of a stream.

        Args:
            targets: int64[K, n] [increments].
            planned: force offsets, float64[K, n] [1/1000 rated].
            target: sent last [increments].
            continued: the last SYNC carried the last row of the stream before.
        """

    def offsets(
        self, row: int, periods: int, doubt: float, channels: Sequence[Channel]
    ) -> Sequence[int]:
        """The force offsets to send with a row, INTEGER16 [1/1000 rated].

        Args:
            row: of the stream.
            periods: from the SYNC of the row before the last one to that of the last one.
            doubt: how far that SYNC left off its place on the grid, over Ts.
            channels: with its samples.
        """


class CorrectedOffsets:
    """The rows of streams with corrected offsets.

    Args:
        correction: chooses them.
        sync: the SYNC producer.
        period_ns: Ts [ns].

    Attributes:
        failure: why the correction stays as it is; None while it works.
    """

    def __init__(self, correction: OffsetCorrection, sync: Exchange, period_ns: int) -> None:
        self.failure: str | None = None
        self._correction, self._sync, self._period = correction, sync, period_ns
        self._before = self._last = -1
        # sent and planned with the last row that was corrected
        self._chosen: Sequence[int] = [0] * len(sync.channels)
        self._planned = np.zeros(len(sync.channels))

    def rows(self, targets: NDArray[np.int64], planned: NDArray[np.float64]) -> Iterator[Row]:
        """The rows of a stream, each made when it is due.

        Args:
            targets: int64[K, n] [increments].
            planned: force offsets, float64[K, n] [1/1000 rated].
        """
        sync, channels = self._sync, self._sync.channels
        for j, channel in enumerate(channels):
            if not channel.accepts_offset:
                planned[:, j] = 0.0
        continued = sync.sent == self._last
        if not continued:
            self._before = sync.sent - self._period
        self._begin(targets, planned, continued)
        for row, target in enumerate(targets.tolist()):
            offsets = self._choose(row, planned)
            frames, setpoints = [], []
            for channel, position, offset in zip(channels, target, offsets, strict=True):
                channel.target, channel.offset = position, offset
                frames.append((channel, channel.pack()))
                setpoints.append((channel, position, channel.offset))
            yield frames, setpoints

    def end(self) -> None:
        """Note that a stream has ended, after whichever row."""
        self._last = self._sync.sent

    def _begin(
        self, targets: NDArray[np.int64], planned: NDArray[np.float64], continued: bool
    ) -> None:
        last = [channel.target for channel in self._sync.channels]
        try:
            self._correction.begin(targets, planned, last, continued)
        except Exception as why:  # noqa: BLE001  the stream goes on
            self._fail(why)

    def _choose(self, row: int, planned: NDArray[np.float64]) -> Sequence[int]:
        sync = self._sync
        passed = sync.sent - self._before
        periods = 1 if passed == self._period else max(1, round(passed / self._period))
        self._before = sync.sent
        if self.failure is None:
            try:
                chosen = self._correction.offsets(
                    row, periods, sync.offset / self._period, sync.channels
                )
                if len(chosen) != len(sync.channels):
                    raise ValueError(f"{len(chosen)} offsets for {len(sync.channels)} axes")
            except Exception as why:  # noqa: BLE001  the stream goes on
                self._fail(why)
            else:
                self._chosen, self._planned = chosen, planned[row]
                return chosen
        held = np.rint(planned[row] + (np.array(self._chosen) - self._planned))
        return [int(offset) for offset in np.clip(held, _LEAST, _MOST)]

    def _fail(self, why: Exception) -> None:
        if self.failure is None:
            self.failure = f"the correction of force offsets failed and stays as it is: {why!r}"
