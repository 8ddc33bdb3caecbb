"""The rows of a stream whose setpoints are known beforehand."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from drivers.cyclic.channel import Channel
from drivers.cyclic.correction import Row

I64 = NDArray[np.int64]


def planned_rows(channels: Sequence[Channel], targets: I64, offsets: I64) -> Iterator[Row]:
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
    channels: Sequence[Channel], targets: I64, offsets: I64
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
