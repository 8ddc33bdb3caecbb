"""Samples of all axes, one row per SYNC: what a stream brings back and what the estimator reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """K SYNCs of n axes in SI units; setpoints as they were sent, after rounding.

    Attributes:
        time: float64[K], place of the SYNC on the grid of its period, since the first SYNC streamed
            after boot [s]. Whole periods may have been skipped.
        position_demand: float64[K, n], r_k [m] (csv: the velocity [m/s], cst: the force [N]).
        force_offset: float64[K, n], f_k [N].
        position: float64[K, n], 0x6064 sampled at the SYNC [m].
        force: float64[K, n], 0x6077 sampled at the SYNC [N].
        statusword: uint16[K, n].
        valid: bool[K, n], False where no TPDO came for this SYNC or another contradicts it; the
            last values stand.
        arrival: float64[K, n], delay of the TPDO after the SYNC [s], nan where missed.
        sync: float64[K], when the SYNC left after its place on the grid [s].
        doubt: float64[K], how much later than that it may have reached the drives [s]; inf where
            only the arrival of their answers bounds it.
        late: bool[K], the SYNC left more than half a period late, or (where the kernel sends it)
            without new setpoints.
        extra: uint8[K, n], additional TPDOs between the previous SYNC and this one.
    """

    time: F64
    position_demand: F64
    force_offset: F64
    position: F64
    force: F64
    statusword: NDArray[np.uint16]
    valid: NDArray[np.bool_]
    arrival: F64
    sync: F64
    doubt: F64
    late: NDArray[np.bool_]
    extra: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.time)

    @property
    def axes(self) -> int:
        """Number of axes n."""
        return int(self.position.shape[1])

    @classmethod
    def missing(cls, count: int, axes: int) -> Samples:
        """`count` rows without any sample: all invalid, all values 0, arrival nan."""
        shape = (count, axes)
        return cls(
            time=np.zeros(count),
            position_demand=np.zeros(shape),
            force_offset=np.zeros(shape),
            position=np.zeros(shape),
            force=np.zeros(shape),
            statusword=np.zeros(shape, dtype=np.uint16),
            valid=np.zeros(shape, dtype=np.bool_),
            arrival=np.full(shape, np.nan),
            sync=np.zeros(count),
            doubt=np.zeros(count),
            late=np.zeros(count, dtype=np.bool_),
            extra=np.zeros(shape, dtype=np.uint8),
        )

    @classmethod
    def concatenate(cls, parts: Sequence[Samples]) -> Samples:
        """Consecutive blocks as one."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in _COLUMNS))

    def tail(self, count: int) -> Samples:
        """The last `count` rows, or all where there are fewer."""
        first = max(len(self) - count, 0)
        return Samples(*[getattr(self, name)[first:] for name in _COLUMNS])


_COLUMNS = tuple(field.name for field in fields(Samples))
