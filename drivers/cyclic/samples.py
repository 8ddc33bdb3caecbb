"""Raw process data per SYNC, as the sink gets it, and its conversion to `stagedata.Samples`."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from struct import Struct

import numpy as np

from drivers.cyclic.channel import Channel
from drivers.drive import Axis
from stagedata import Samples

Sample = tuple[int, ...]
"""One SYNC for the sink: (time_ns, late, sync_ns, doubt_ns, then per axis: target_counts,
offset_permille, position_counts, force_permille, statusword, valid, arrival_ns, extra). `arrival`
is -1 without a sample, `doubt` -1 where unknown. `extra` belongs to the SYNC before: its TPDOs
besides the sample until this SYNC, at most 255."""
Sink = Callable[[Sample], object]

HEAD, FIELDS, VALID = 4, 8, 5
"""Values in a `Sample` before those of the axes; values per axis; index of `valid` among them."""


class SampleWriter:
    """Passes samples on in order; one that lacks a TPDO waits until the next SYNC is over.

    Args:
        channels: of all axes.
        rows: gets the values of every sample.
        sink: called with every sample, None for none.
        waits: whether a tardy TPDO can complete a sample.
    """

    def __init__(
        self, channels: Sequence[Channel], rows: array[int], sink: Sink | None, waits: bool
    ) -> None:
        self._channels = channels
        # packed first: appending single numbers to an array takes seven times as long
        self._pack = Struct(f"{HEAD + FIELDS * len(channels)}q").pack
        self._extend, self._sink, self._waits = rows.frombytes, sink, waits
        self.waiting: list[int] | None = None

    def write(self, values: list[int], complete: bool) -> None:
        """Takes the sample of one more SYNC."""
        if self.waiting is not None:
            self._pass_on(self._completed(self.waiting, [c.previous_tardy for c in self._channels]))
            self.waiting = None
        if complete or not self._waits:
            self._pass_on(values)
        else:
            self.waiting = values

    def flush(self) -> None:
        """Passes on a sample that still waits."""
        values, self.waiting = self.waiting, None
        if values is not None:
            self._pass_on(self._completed(values, [c.tardy for c in self._channels]))

    def _pass_on(self, values: list[int]) -> None:
        self._extend(self._pack(*values))
        if self._sink is not None:
            self._sink(tuple(values))

    @staticmethod
    def _completed(
        values: list[int], tardy: Sequence[tuple[int, int, int, int] | None]
    ) -> list[int]:
        """The sample with the TPDOs that arrived after the host had stopped waiting."""
        for axis, late in enumerate(tardy):
            at = HEAD + axis * FIELDS
            if late is not None and not values[at + VALID]:
                status, position, force, arrival = late
                values[at + 2 : at + 7] = (position, force, status, True, arrival)
        return values


def decode_rows(
    rows: array[int], axes: Sequence[Axis], targets: Sequence[float] | None = None
) -> Samples:
    """Samples from the concatenated `Sample` tuples of any number of SYNCs.

    Args:
        rows: the tuples.
        axes: whose units they are in.
        targets: SI value of one unit of each axis' target; None: targets are positions.
    """
    n = len(axes)
    raw = np.frombuffer(rows, dtype=np.int64).reshape(-1, HEAD + FIELDS * n)
    values = raw[:, HEAD:].reshape(-1, n, FIELDS)
    increment = np.array([axis.increment for axis in axes])
    force = np.array([axis.force_unit for axis in axes])
    valid = values[:, :, VALID] != 0
    return Samples(
        time=np.asarray(raw[:, 0] * 1e-9, dtype=np.float64),
        position_demand=values[:, :, 0] * (increment if targets is None else np.array(targets)),
        force_offset=values[:, :, 1] * force,
        position=values[:, :, 2] * increment,
        force=values[:, :, 3] * force,
        statusword=values[:, :, 4].astype(np.uint16),
        valid=valid,
        arrival=np.where(valid, values[:, :, 6] * 1e-9, np.nan),
        sync=np.asarray(raw[:, 2] * 1e-9, dtype=np.float64),
        doubt=np.where(raw[:, 3] < 0, np.inf, raw[:, 3] * 1e-9),
        late=raw[:, 1] != 0,
        extra=values[:, :, 7].astype(np.uint8),
    )
