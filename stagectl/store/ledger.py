"""The cycle ledger: how punctual every SYNC period of a run was.

Per SYNC it holds when each axis' TPDO came, how many more came before the next SYNC, and whether
the host itself was late. It says nothing of the samples' values; a missing TPDO is also `valid` = 0
in the recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, eq=False)
class CycleLedger:
    """Punctuality of K cycles.

    Attributes:
        arrival: axis -> float64[K], arrival of its TPDO after its SYNC [s], nan where it missed.
        late: bool[K], SYNC k went out late, or without new setpoints.
        extra: axis -> uint8[K], TPDOs that came besides before the next SYNC: the first of them is
            the late one where the sample is missed, any other is a double. Axes without: none.
        sync: float64[K], when SYNC k left after its place on the grid [s]; None: not told.
        doubt: float64[K], by how much later than that it may have reached the drives [s], nan where
            only the arrivals tell; None: not told.
    """

    arrival: Mapping[str, npt.NDArray[np.float64]]
    late: npt.NDArray[np.bool_]
    extra: Mapping[str, npt.NDArray[np.uint8]] = field(default_factory=dict)
    sync: npt.NDArray[np.float64] | None = None
    doubt: npt.NDArray[np.float64] | None = None

    @property
    def missed_per_cycle(self) -> npt.NDArray[np.uint8]:
        """uint8[K], how many axes' TPDOs did not come in the window of SYNC k."""
        missed = np.zeros(len(self.late), dtype=np.uint8)
        for arrival in self.arrival.values():
            missed += np.isnan(arrival).astype(np.uint8)
        return missed

    @property
    def tardy_per_cycle(self) -> npt.NDArray[np.uint8]:
        """uint8[K], how many of those came after all, before the next SYNC."""
        tardy = np.zeros(len(self.late), dtype=np.uint8)
        for axis, extra in self.extra.items():
            tardy += ((extra > 0) & np.isnan(self.arrival[axis])).astype(np.uint8)
        return tardy

    @property
    def doubled_per_cycle(self) -> npt.NDArray[np.uint8]:
        """uint8[K], how many TPDOs of SYNC k came once more than they should, all axes together."""
        total = np.zeros(len(self.late), dtype=np.int64)
        for extra in self.extra.values():
            total += extra
        doubled: npt.NDArray[np.uint8] = np.minimum(total - self.tardy_per_cycle, 255).astype(
            np.uint8
        )
        return doubled

    @property
    def missed(self) -> int:
        """TPDOs that did not come in their window, all axes together."""
        return int(self.missed_per_cycle.sum())

    @property
    def tardy(self) -> int:
        """TPDOs that came after their window, but before the next SYNC."""
        return int(self.tardy_per_cycle.sum())

    @property
    def doubled(self) -> int:
        """TPDOs that came more than once."""
        return int(self.doubled_per_cycle.sum(dtype=np.int64))

    @property
    def late_cycles(self) -> int:
        """Cycles whose SYNC the host sent late."""
        return int(np.count_nonzero(self.late))

    @property
    def late_in_a_row(self) -> int:
        """Longest run of late cycles."""
        edges = np.diff(np.concatenate(([0], self.late.astype(np.int8), [0])))
        runs = np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)
        return int(runs.max()) if len(runs) else 0
