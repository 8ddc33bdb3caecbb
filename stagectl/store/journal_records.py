"""The records of a journal's bytes; what is damaged is left out, and the next whole record found.

Layout: `journal`.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from stagectl.store.journal import CHECKSUM, SAMPLE_TAG, TEXT_HEAD, TEXT_TAG, sample_dtype

Samples = npt.NDArray[np.void]
_BLOCK = 8192  # records examined at once
_TAG = re.compile(rb"[%c%c]" % (SAMPLE_TAG, TEXT_TAG))


class Records:
    """Iterates over blocks of samples and notes, in order.

    Where samples are missing, the index of the next block says how many.

    Args:
        data: of the journal.
        at: where the first record begins.
        axes: number of axes.

    Attributes:
        samples: number of samples so far, missing ones included.
        damaged: bytes left out so far; those of a record that was cut at the end do not count.
    """

    def __init__(self, data: bytes, at: int, axes: int) -> None:
        self.samples, self.damaged = 0, 0
        self._data, self._at = data, at
        self._dtype = sample_dtype(axes)
        self._skipped = 0  # since the last sample

    def __iter__(self) -> Iterator[Samples | dict[str, Any]]:
        data, good = self._data, self._at
        record: Samples | dict[str, Any] | None
        while self._at < len(data):
            record, size = self._sample_block()
            if record is None:
                record, size = self._note()
            if record is None:
                following = _TAG.search(data, self._at + 1)
                if following is None:
                    break
                self._skipped += following.start() - self._at
                self._at = following.start()
                continue
            self.damaged += self._at - good
            good = self._at = self._at + size
            if isinstance(record, np.ndarray):
                self._skipped = 0
                self.samples = int(record["index"][0]) + len(record)
            yield record
        if not self._is_cut(good):
            self.damaged += len(data) - good

    def _sample_block(self) -> tuple[Samples | None, int]:
        """The whole samples from here on, and their size; None if there is none."""
        data, at, size = self._data, self._at, self._dtype.itemsize
        if data[at] != SAMPLE_TAG or len(data) - at < size:
            return None, 0
        if not self._are_whole(at, 1)[0]:
            return None, 0
        count = min((len(data) - at) // size, _BLOCK)
        block = np.frombuffer(data, self._dtype, count, at)
        first = int(block["index"][0])
        if not 0 <= first - self.samples <= self._skipped // size:
            return None, 0
        good = (block["tag"] == SAMPLE_TAG) & (block["index"] == first + np.arange(count))
        good &= self._are_whole(at, count)
        if not good.all():
            count = int(np.argmin(good))
        return block[:count], count * size

    def _are_whole(self, at: int, count: int) -> npt.NDArray[np.bool_]:
        """bool[count], whether the samples from a position on have the CRC that was written."""
        size, view = self._dtype.itemsize, memoryview(self._data)
        covered = size - CHECKSUM.size
        starts = range(at, at + count * size, size)
        found = np.fromiter((zlib.crc32(view[k : k + covered]) for k in starts), np.uint32, count)
        stated = np.frombuffer(self._data, self._dtype, count, at)["crc"]
        same: npt.NDArray[np.bool_] = found == stated
        return same

    def _note(self) -> tuple[dict[str, Any] | None, int]:
        """The note here, and its size; None if there is no whole one."""
        data, at = self._data, self._at
        if data[at] != TEXT_TAG or len(data) - at < TEXT_HEAD.size:
            return None, 0
        _, length, checksum = TEXT_HEAD.unpack_from(data, at)
        body = data[at + TEXT_HEAD.size : at + TEXT_HEAD.size + length]
        # Zeros in place of a note have the checksum of an empty one.
        if not length or len(body) < length or zlib.crc32(body) != checksum:
            return None, 0
        return json.loads(body), TEXT_HEAD.size + length

    def _is_cut(self, at: int) -> bool:
        """Whether what is left is the beginning of one record, as a kill leaves it."""
        left = self._data[at:]
        if not left:
            return True
        if left[0] == SAMPLE_TAG:
            return len(left) < self._dtype.itemsize
        if left[0] != TEXT_TAG or len(left) < TEXT_HEAD.size:
            return left[0] == TEXT_TAG
        _, length, _ = TEXT_HEAD.unpack_from(left)
        return bool(length and length > len(left) - TEXT_HEAD.size)


def fill_missing(found: Samples, axes: int) -> Samples:
    """All samples in a row; missing ones as if no axis had answered.

    Their times, setpoints and offsets are interpolated, positions and forces those of the sample
    before.

    Args:
        found: with the field `index`, ascending; at least one sample.
        axes: number of axes.
    """
    count = int(found["index"][-1]) + 1
    if count == len(found):
        return found
    index = found["index"].astype(np.int64)
    every = np.arange(count)
    before = np.maximum(np.searchsorted(index, every, side="right") - 1, 0)
    filled = found[before]
    missing = np.ones(count, np.bool_)
    missing[index] = False
    filled["index"] = every
    for name in ("time", *(f"{what}_{i}" for what in ("target", "offset") for i in range(axes))):
        start = found[name][0]
        values = np.interp(every, index, found[name] - start)
        filled[name][missing] = start + np.rint(values[missing]).astype(np.int64)
    for name, value in (("late", 0), ("sync", 0), ("doubt", -1)):
        filled[name][missing] = value
    for i in range(axes):
        for what, value in (("valid", 0), ("arrival", -1), ("extra", 0)):
            filled[f"{what}_{i}"][missing] = value
    lead = int(index[0])  # before the first sample there is no other to interpolate from
    step = int(np.median(np.diff(found["time"]))) if len(found) > 1 else 1
    filled["time"][:lead] = found["time"][0] - step * np.arange(lead, 0, -1)
    return filled
