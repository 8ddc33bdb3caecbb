"""The observer between the driver's cyclic path and its mathematics (`estimation.observer`).

The driver calls it with every row of a stream, between the last sample and the next SYNC.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.cyclic import Channel
from estimation.observer import StageObserver


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
        self, row: int, periods: int, doubt: float, channels: Sequence[Channel]
    ) -> list[int]:
        """The force offsets of a row [1/1000 of the rated force].

        Arguments as in `drivers.cyclic.OffsetCorrection`.
        """
        for values, channel in zip(self._rows, channels, strict=True):
            values[0], values[1] = channel.position, channel.force
            values[2], values[3] = channel.valid, channel.arrival
        return self._observer.offsets(row, periods, doubt)
