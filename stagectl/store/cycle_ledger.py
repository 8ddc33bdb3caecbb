"""The cycle ledger: punctuality of every SYNC period of a run.

Per SYNC it holds when each axis' TPDO arrived, how many more arrived before the next SYNC, and
whether the host was late. A missed TPDO is also `valid` = 0 in the recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from stagedata import F64


@dataclass(frozen=True, slots=True, eq=False)
class CycleLedger:
    """Punctuality of K cycles.

    Attributes:
        arrival: axis -> float64[K], delay of its TPDO after SYNC [s], nan where it was missed.
        late: bool[K], SYNC k was sent late, or without new setpoints.
        extra: axis -> uint8[K], additional TPDOs before the next SYNC. Where the sample is missed,
            the first of them is the tardy one; all others are duplicates. An absent axis has none.
        sync: float64[K], when SYNC k left after its place on the grid [s]; None: unknown.
        doubt: float64[K], how much later than that it may have reached the drives [s], nan where
            only the arrivals bound it; None: unknown.
    """

    arrival: Mapping[str, F64]
    late: npt.NDArray[np.bool_]
    extra: Mapping[str, npt.NDArray[np.uint8]] = field(default_factory=dict)
    sync: F64 | None = None
    doubt: F64 | None = None

    @property
    def missed_per_cycle(self) -> npt.NDArray[np.uint8]:
        """uint8[K], number of axes whose TPDO did not arrive in the window of SYNC k."""
        missed = np.zeros(len(self.late), dtype=np.uint8)
        for arrival in self.arrival.values():
            missed += np.isnan(arrival).astype(np.uint8)
        return missed

    @property
    def tardy_per_cycle(self) -> npt.NDArray[np.uint8]:
        """uint8[K], how many of those arrived later, but before the next SYNC."""
        tardy = np.zeros(len(self.late), dtype=np.uint8)
        for axis, extra in self.extra.items():
            tardy += ((extra > 0) & np.isnan(self.arrival[axis])).astype(np.uint8)
        return tardy

    @property
    def doubled_per_cycle(self) -> npt.NDArray[np.uint8]:
        """uint8[K], number of duplicate TPDOs of SYNC k, all axes together."""
        total = np.zeros(len(self.late), dtype=np.int64)
        for extra in self.extra.values():
            total += extra
        doubled: npt.NDArray[np.uint8] = np.minimum(total - self.tardy_per_cycle, 255).astype(
            np.uint8
        )
        return doubled

    @property
    def late_in_a_row(self) -> int:
        """Longest run of late cycles."""
        edges = np.diff(np.concatenate(([0], self.late.astype(np.int8), [0])))
        runs = np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)
        return int(runs.max()) if len(runs) else 0
