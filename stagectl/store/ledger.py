"""The cycle ledger: how punctual every SYNC period of a run was.

Per SYNC it holds when each axis' TPDO came and whether the host itself was late. It says nothing
of the samples' values; a missing TPDO is also `valid` = 0 in the recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, eq=False)
class CycleLedger:
    """Punctuality of K cycles.

    Attributes:
        arrival: axis -> float64[K], arrival of its TPDO after its SYNC [s], nan where it missed.
        late: bool[K], the host sent SYNC k late.
    """

    arrival: Mapping[str, npt.NDArray[np.float64]]
    late: npt.NDArray[np.bool_]

    @property
    def missed_per_cycle(self) -> npt.NDArray[np.uint8]:
        """uint8[K], how many axes' TPDOs did not come in the window of SYNC k."""
        missed = np.zeros(len(self.late), dtype=np.uint8)
        for arrival in self.arrival.values():
            missed += np.isnan(arrival).astype(np.uint8)
        return missed

    @property
    def missed(self) -> int:
        """TPDOs that did not come in their window, all axes together."""
        return int(self.missed_per_cycle.sum())

    @property
    def late_cycles(self) -> int:
        """Cycles whose SYNC the host sent late."""
        return int(np.count_nonzero(self.late))
