"""The observer between the driver's cyclic path and its mathematics (`estimation.observer`).

The driver calls it with every row of a stream, between the last sample and the next SYNC.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from estimation.observer import StageObserver


class Sampled(Protocol):
    """An axis as last sampled, in the integers of the bus.

    Attributes:
        position: [increments].
        force: [1/1000 rated].
        valid: whether the last SYNC brought a sample.
        arrival: time from SYNC to the arrival of its frame [ns].
    """

    position: int
    force: int
    valid: bool
    arrival: int


class ObservedOffsets:
    """A `drivers.cyclic.OffsetCorrection` by the settling observer.

    Args:
        observer: of all axes.
    """

    def __init__(self, observer: StageObserver) -> None:
        self._observer = observer
        self.begin = observer.begin
        # numbers are written to a memoryview in a third of the time that an array takes
        self._rows = [memoryview(row) for row in observer.sample]

    def offsets(
        self, row: int, periods: int, doubt: float, channels: Sequence[Sampled]
    ) -> list[int]:
        """The force offsets of a row [1/1000 of the rated force].

        Arguments as in `drivers.cyclic.OffsetCorrection`.
        """
        for values, channel in zip(self._rows, channels, strict=True):
            values[0], values[1] = channel.position, channel.force
            values[2], values[3] = channel.valid, channel.arrival
        return self._observer.offsets(row, periods, doubt)
