"""A stream whose setpoints are known beforehand, in blocks of SYNCs, on a bus that allows it.

The SYNCs of a block are exchanged in one call (`direct_exchange`); its samples are decoded at the
end of the stream, with those of all other blocks. A block ends before the host's services are due,
and with the first SYNC that brings anything but one TPDO of each axis with its statusword
unchanged. That SYNC, and each that has to be sent by itself, is left to the caller to judge.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.cyclic.channel import Channel
from drivers.cyclic.samples import FIELDS, HEAD, VALID
from drivers.cyclic.setpoints import packed_rows
from drivers.cyclic.sync_producer import Exchange
from drivers.drive import ENABLED_MASK, ENABLED_VALUE

I64 = NDArray[np.int64]

Exchanged = tuple[int, Sequence[tuple[Channel, int, int]]]
"""Of one SYNC: 1 where it was late, else 0; each channel with its target and offset."""


class BlockStream:
    """One stream.

    Args:
        sync: the SYNC producer.
        targets: int64[K, n] [increments].
        offsets: int64[K, n] [1/1000 rated].
        rows: gets room for the samples of each block, which `decode` fills; those of all other
            SYNCs are appended by the caller.
        alarmed: nodes with an alarm; there are no blocks while there is one.
    """

    def __init__(
        self,
        sync: Exchange,
        targets: I64,
        offsets: I64,
        rows: array[int],
        alarmed: Sequence[object],
    ) -> None:
        self._sync, self._channels = sync, sync.channels
        self._packed = list(packed_rows(sync.channels, targets, offsets))
        self._targets, self._offsets, self._rows = targets, offsets, rows
        self._width = HEAD + FIELDS * len(sync.channels)
        self._alarmed, self._next = alarmed, 0
        self._blocks: list[tuple[int, int, int]] = []  # place in `rows`, row, time of last SYNC
        self._counts: list[int] = []
        self._answers: list[bytes] = []

    def run(self) -> Iterator[Exchanged]:
        """Streams; gives each SYNC that was not part of a block.

        Raises:
            BusError: the bus fails.
        """
        sync, channels, count = self._sync, self._channels, len(self._targets)
        while self._next < count:
            most = min(sync.most_at_once(), count - self._next)
            # the first one by itself: what came before it may be anything
            if most > 1 and self._next and not self._alarmed and all(map(_is_steady, channels)):
                late = self._run_block(self._packed[self._next : self._next + most])
                if late is None:
                    continue
            else:
                late = sync.run(list(zip(channels, self._packed[self._next], strict=True)))
            setpoints = self._setpoints(self._next)
            self._next += 1
            yield late, setpoints

    def _run_block(self, rows: list[tuple[bytes, ...]]) -> int | None:
        """Exchanges a block; None where all of it is done, else whether its last SYNC was late."""
        answers: list[bytes] = []
        expected = [(*c.tpdo, c.statusword.to_bytes(2, "little")) for c in self._channels]
        first = self._sync.sent + self._sync.period
        try:
            return self._sync.run_at_once(rows, expected, answers)
        finally:
            done = len(answers) // len(self._channels)
            if done:
                self._blocks.append((len(self._rows) // self._width, self._next, first))
                self._counts.append(done)
                self._rows.frombytes(bytes(8 * self._width * done))
                self._answers += answers
                self._next += done
                for channel, target, offset in self._setpoints(self._next - 1):
                    channel.target, channel.offset = target, offset

    def _setpoints(self, row: int) -> list[tuple[Channel, int, int]]:
        """Each channel with its target and offset."""
        columns = self._channels, self._targets[row].tolist(), self._offsets[row].tolist()
        return list(zip(*columns, strict=True))

    def decode(self, origin: int) -> None:
        """Fills in the samples of all blocks.

        Args:
            origin: time of the first SYNC of all streams [ns].
        """
        if not self._blocks:
            return
        counts = np.array(self._counts)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        place, row, first = np.repeat(np.array(self._blocks), counts, axis=0).T
        samples = np.zeros((len(within), self._width), dtype=np.int64)
        samples[:, 0] = first - origin + within * self._sync.period
        samples[:, HEAD - 1] = -1
        for j, channel in enumerate(self._channels):
            codes = [e.code for e in channel.axis.tpdo.entries]
            names = ("status", "position", "force")[: len(codes)]
            tpdos = np.frombuffer(
                b"".join(self._answers[j :: len(self._channels)]),
                dtype=[(n, "<" + c) for n, c in zip(names, codes, strict=True)],
            )
            axis = samples[:, HEAD + FIELDS * j :][:, :FIELDS]
            axis[:, 0] = self._targets[row + within, j]
            axis[:, 1] = self._offsets[row + within, j]
            axis[:, 2] = tpdos["position"]
            if len(names) > 2:
                axis[:, 3] = tpdos["force"]
            axis[:, 4] = tpdos["status"]
            axis[:, VALID] = 1
        np.frombuffer(self._rows, dtype=np.int64).reshape(-1, self._width)[place + within] = samples


def _is_steady(channel: Channel) -> bool:
    """Whether an axis is enabled and has answered the last SYNC, once."""
    return (
        channel.valid
        and not channel.extra
        and not channel.doubled
        and channel.statusword & ENABLED_MASK == ENABLED_VALUE
    )
