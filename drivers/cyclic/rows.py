"""The rows of a stream: planned beforehand, or with force offsets corrected from SYNC to SYNC.

For a correction the application chooses each row's offsets after the sample before it. Whatever
goes wrong there does not stop the stream: the last correction stays in effect.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from itertools import repeat
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.cyclic.channel import Channel
from drivers.cyclic.sync_producer import Exchange, Frames
from stagedata import F64

_LEAST, _MOST = -32768, 32767

Row = tuple[Frames, Sequence[tuple[Channel, int, int]]]
"""Of a stream: each channel with its RPDO, and each channel with its target and offset."""


def planned_rows(
    channels: Sequence[Channel], targets: NDArray[np.int64], offsets: NDArray[np.int64]
) -> Iterator[Row]:
    """Per SYNC: each channel with its RPDO, and each channel with its target and offset.

    Pairs are made row by row: all of them at once would make the first SYNC late.

    Args:
        channels: n of them.
        targets: int64[K, n] [increments].
        offsets: int64[K, n] [1/1000 rated]; set to 0 where an RPDO carries none.
    """
    packed = _packed_rows(channels, targets, offsets)  # sets offsets
    setpoints = [
        zip(repeat(channel), targets[:, j].tolist(), offsets[:, j].tolist(), strict=False)
        for j, channel in enumerate(channels)
    ]
    return zip(
        (tuple(zip(channels, row, strict=True)) for row in packed),
        zip(*setpoints, strict=True),
        strict=True,
    )


def _packed_rows(
    channels: Sequence[Channel], targets: NDArray[np.int64], offsets: NDArray[np.int64]
) -> Iterator[tuple[bytes, ...]]:
    """Per SYNC: the RPDOs of all channels; arguments as for `planned_rows`."""
    blocks, sizes = [], []
    for j, channel in enumerate(channels):
        if not channel.accepts_offset:
            offsets[:, j] = 0
        names = ("controlword", "target", "offset")[: len(channel.axis.rpdo.entries)]
        codes = [e.code for e in channel.axis.rpdo.entries]
        block = np.empty(
            len(targets), dtype=[(n, "<" + c) for n, c in zip(names, codes, strict=True)]
        )
        block["controlword"] = channel.controlword
        block["target"] = targets[:, j]
        if len(names) > 2:
            block["offset"] = offsets[:, j]
        sizes.append(block.dtype.itemsize)
        blocks.append(block.view(np.uint8).reshape(len(block), -1))
    data = np.concatenate(blocks, axis=1).tobytes()
    return struct.iter_unpack("".join(f"{size}s" for size in sizes), data)


class OffsetCorrection(Protocol):
    """Chooses the force offsets of a stream, row by row; called in the thread that sends SYNC."""

    def begin(
        self,
        targets: NDArray[np.int64],
        planned: F64,
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

    Attributes:
        failure: why the correction stays as it is; None while it works.
    """

    def __init__(self, correction: OffsetCorrection, sync: Exchange) -> None:
        self.failure: str | None = None
        self._correction, self._sync, self._period = correction, sync, sync.period
        self._before = self._last = -1
        # sent and planned with the last row that was corrected
        self._chosen: Sequence[int] = [0] * len(sync.channels)
        self._planned = np.zeros(len(sync.channels))

    def rows(self, targets: NDArray[np.int64], planned: F64) -> Iterator[Row]:
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

    def _begin(self, targets: NDArray[np.int64], planned: F64, continued: bool) -> None:
        last = [channel.target for channel in self._sync.channels]
        try:
            self._correction.begin(targets, planned, last, continued)
        except Exception as why:  # noqa: BLE001  the stream goes on
            self._fail(why)

    def _choose(self, row: int, planned: F64) -> Sequence[int]:
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
