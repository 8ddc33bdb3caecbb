"""What streaming brings back: raw integers per SYNC for the sink, SI arrays for the engine."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Sample = tuple[int, ...]
"""One SYNC for the sink: (time_ns, late, sync_ns, doubt_ns, then per axis: target_counts,
offset_permille, position_counts, force_permille, statusword, valid, arrival_ns, extra); arrival -1
when there is no sample, doubt -1 when not known. `extra` belongs to the SYNC before: its TPDOs that
came besides until this SYNC, at most 255."""

HEAD, FIELDS, VALID = 4, 8, 5
"""Values in a `Sample` before those of the axes; values per axis; place of `valid` among them."""


@dataclass(frozen=True, slots=True)
class Scale:
    """What one unit of an axis' CAN integers is: `increment` [m], `force` [N] (rated / 1000)."""

    increment: float
    force: float


@dataclass(frozen=True, slots=True)
class Samples:
    """K SYNCs of n axes, SI, demands as they were sent (after rounding).

    Attributes:
        time: float64[K], place of the SYNC on the grid of its period, since the first SYNC streamed
            after boot [s].
        position_demand: float64[K, n], r_k [m] (csv: the velocity [m/s], cst: the force [N]).
        force_offset: float64[K, n], f_k [N].
        position: float64[K, n], 0x6064 sampled at the SYNC [m].
        force: float64[K, n], 0x6077 sampled at the SYNC [N].
        statusword: uint16[K, n].
        valid: bool[K, n], False where the TPDO stayed away, or another one contradicts it, and the
            last values stand.
        arrival: float64[K, n], of the TPDO after the SYNC [s], nan where missed.
        sync: float64[K], when the SYNC left after its place on the grid [s].
        doubt: float64[K], by how much later than that it may have reached the drives [s], inf where
            nothing but the arrival of their answers tells.
        late: bool[K], the SYNC left more than half a period after its instant, or (where the kernel
            sends it) without new setpoints.
        extra: uint8[K, n], TPDOs that came besides between the SYNC before and this one.
    """

    time: NDArray[np.float64]
    position_demand: NDArray[np.float64]
    force_offset: NDArray[np.float64]
    position: NDArray[np.float64]
    force: NDArray[np.float64]
    statusword: NDArray[np.uint16]
    valid: NDArray[np.bool_]
    arrival: NDArray[np.float64]
    sync: NDArray[np.float64]
    doubt: NDArray[np.float64]
    late: NDArray[np.bool_]
    extra: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def from_rows(
        cls, rows: array[int], scales: Sequence[Scale], targets: Sequence[float] | None = None
    ) -> Samples:
        """Samples from the concatenated `Sample` tuples of any number of SYNCs.

        Args:
            rows: the tuples.
            scales: of the axes.
            targets: unit of each axis' targets; None: they are positions.
        """
        n = len(scales)
        raw = np.frombuffer(rows, dtype=np.int64).reshape(-1, HEAD + FIELDS * n)
        axes = raw[:, HEAD:].reshape(-1, n, FIELDS)
        increment = np.array([s.increment for s in scales])
        force = np.array([s.force for s in scales])
        valid = axes[:, :, 5] != 0
        return cls(
            time=np.asarray(raw[:, 0] * 1e-9, dtype=np.float64),
            position_demand=axes[:, :, 0] * (increment if targets is None else np.array(targets)),
            force_offset=axes[:, :, 1] * force,
            position=axes[:, :, 2] * increment,
            force=axes[:, :, 3] * force,
            statusword=axes[:, :, 4].astype(np.uint16),
            valid=valid,
            arrival=np.where(valid, axes[:, :, 6] * 1e-9, np.nan),
            sync=np.asarray(raw[:, 2] * 1e-9, dtype=np.float64),
            doubt=np.where(raw[:, 3] < 0, np.inf, raw[:, 3] * 1e-9),
            late=raw[:, 1] != 0,
            extra=axes[:, :, 7].astype(np.uint8),
        )
