"""Samples of a move on their way from the bus to the estimator: which of them can be used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

PUNCTUAL = 0.01
"""A sample may come this share of Ts off the median arrival in any case ..."""
SCATTER = 4.0
"""... and so many times the median scatter of its move ..."""
LOOSE = 0.04
"""... but never more than this share of Ts: a move with less punctual samples teaches nothing."""


class Block(Protocol):
    """Samples that a stream brought back: float64[K, n] in SI units, `valid` bool[K, n]."""

    @property
    def position(self) -> F64:
        """Position actual [m]."""

    @property
    def force(self) -> F64:
        """Force actual [N]."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether the sample came."""

    @property
    def time(self) -> F64:
        """Of the SYNCs, on the grid of Ts [s], shape (K,); whole periods may be passed over."""

    @property
    def late(self) -> NDArray[np.bool_]:
        """Whether the SYNC went out late, shape (K,)."""

    @property
    def arrival(self) -> F64:
        """When the sample came after its SYNC was sent [s], nan where it did not."""


@dataclass(frozen=True, slots=True)
class MoveSamples:
    """Consecutive samples; a late one is no measurement of its instant, so it counts as invalid.

    Attributes:
        time: of the SYNCs [s], shape (K,).
        position: actual [m], shape (K, n).  force: actual [N].
        valid: whether it can be used.  arrival: after the SYNC [s], nan where it did not come.
    """

    time: F64
    position: F64
    force: F64
    valid: NDArray[np.bool_]
    arrival: F64

    @classmethod
    def none(cls, axes: int) -> MoveSamples:
        """Of so many axes, empty."""
        empty = np.zeros((0, axes))
        return cls(np.zeros(0), empty, empty, np.zeros((0, axes), dtype=np.bool_), empty)

    @classmethod
    def of(cls, block: Block) -> MoveSamples:
        """What a stream brought back."""
        valid = block.valid & ~block.late[:, None]
        return cls(block.time, block.position, block.force, valid, block.arrival)

    @classmethod
    def joined(cls, parts: Sequence[MoveSamples]) -> MoveSamples:
        """Several, one after the other."""
        return cls(
            np.concatenate([p.time for p in parts]),
            np.concatenate([p.position for p in parts]),
            np.concatenate([p.force for p in parts]),
            np.concatenate([p.valid for p in parts]),
            np.concatenate([p.arrival for p in parts]),
        )

    def __len__(self) -> int:
        return len(self.time)

    def last(self, count: int) -> MoveSamples:
        """The last so many."""
        return MoveSamples(
            self.time[-count:], self.position[-count:], self.force[-count:], self.valid[-count:],
            self.arrival[-count:],
        )  # fmt: skip

    def mean_force(self) -> F64:
        """Mean force of each axis over its valid samples, over all where there is none."""
        means = [
            float(values[ok].mean() if ok.any() else values.mean())
            for values, ok in zip(self.force.T, self.valid.T, strict=True)
        ]
        return np.array(means)

    def bridged(self) -> F64:
        """Positions with straight lines where samples are invalid [m], shape (K, n)."""
        index = np.arange(len(self))
        columns = [
            np.interp(index, index[ok], values[ok]) if ok.any() else values
            for values, ok in zip(self.position.T, self.valid.T, strict=True)
        ]
        return np.column_stack(columns)

    def punctual(self, period: float) -> MoveSamples:
        """With those invalid that came noticeably sooner or later than their axis' median.

        They were not taken at their instant, as far as one can tell: at 10 mm/s, 10 us off is
        0.1 um off, which looks like 2 N on 8 kg. What is noticeable depends on how much all of
        them scatter: nothing on the lock-step bus, tens of microseconds in user space.

        Args:
            period: Ts [s].
        """
        valid = self.valid.copy()
        for arrival, ok in zip(self.arrival.T, valid.T, strict=True):
            if ok.any():
                away = np.abs(arrival - np.median(arrival[ok]))
                usual = SCATTER * float(np.median(away[ok]))
                ok &= away <= min(max(PUNCTUAL * period, usual), LOOSE * period)
        return MoveSamples(self.time, self.position, self.force, valid, self.arrival)

    def on_grid(self, period: float) -> MoveSamples:
        """With an invalid sample wherever a SYNC period was passed over."""
        place = np.round((self.time - self.time[0]) / period).astype(np.int64)
        if place[-1] == len(place) - 1:
            return self
        count, axes = int(place[-1]) + 1, self.position.shape[1]
        position, force = np.zeros((count, axes)), np.zeros((count, axes))
        valid = np.zeros((count, axes), dtype=np.bool_)
        arrival = np.full((count, axes), np.nan)
        position[place], force[place], valid[place] = self.position, self.force, self.valid
        arrival[place] = self.arrival
        time = self.time[0] + period * np.arange(count)
        return MoveSamples(time, position, force, valid, arrival)
