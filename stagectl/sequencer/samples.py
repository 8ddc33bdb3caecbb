"""Samples of a move on their way from the bus to the estimator: which of them can be used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

PUNCTUAL = 0.01
"""The instant of a sample has to be known to this share of Ts."""
EXACT = 1e-5
"""A SYNC that is off its place by less than this share of Ts is where it belongs."""
REACH = 0.3
"""A sample may be brought back to its place from so much of Ts away."""
STALE_STEPS = 20
"""An axis that jumps by so many of its smallest steps had moved while its samples repeated."""

_NODES, _SPREAD = 4, 5
"""Samples that a position between them is read from, within so many periods."""


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

    @property
    def sync(self) -> F64:
        """When the SYNC left after its place on the grid [s], shape (K,)."""

    @property
    def doubt(self) -> F64:
        """How much later than that it may have reached the drives [s]; inf: not known."""

    @property
    def extra(self) -> NDArray[np.uint8]:
        """Samples that came besides, between the SYNC before and this one, shape (K, n)."""


@dataclass(frozen=True, slots=True)
class MoveSamples:
    """Consecutive samples; a late one is no measurement of its instant, so it counts as invalid.

    A drive samples when SYNC reaches it (CiA 301). Two things make a sample another than the grid
    says: its SYNC left early or late, which the host has measured and `placed` takes back; or SYNC
    was under way for longer than usual, which only shows by what it cannot have exceeded
    (`punctual`). How long the answer took says nothing more than that.

    Attributes:
        time: of the SYNCs [s], shape (K,).
        position: actual [m], shape (K, n).  force: actual [N].
        valid: whether it can be used.  arrival: after the SYNC [s], nan where it did not come.
        sync: when the SYNC left after its place [s], shape (K,).
        doubt: by how much later than that the drives may have had it [s], shape (K,).
    """

    time: F64
    position: F64
    force: F64
    valid: NDArray[np.bool_]
    arrival: F64
    sync: F64
    doubt: F64

    @classmethod
    def none(cls, axes: int) -> MoveSamples:
        """Of so many axes, empty."""
        empty = np.zeros((0, axes))
        valid = np.zeros((0, axes), dtype=np.bool_)
        return cls(np.zeros(0), empty, empty, valid, empty, np.zeros(0), np.zeros(0))

    @classmethod
    def of(cls, block: Block) -> MoveSamples:
        """What a stream brought back.

        Behind a hole, the first of two samples that came for one SYNC answers a SYNC before: the
        drive was held up.
        """
        valid = block.valid & ~block.late[:, None]
        valid[1:-1] &= (block.extra[2:] == 0) | block.valid[:-2]
        return cls(
            block.time, block.position, block.force, valid, block.arrival, block.sync, block.doubt
        )

    @classmethod
    def joined(cls, parts: Sequence[MoveSamples]) -> MoveSamples:
        """Several, one after the other."""
        return cls(
            np.concatenate([p.time for p in parts]),
            np.concatenate([p.position for p in parts]),
            np.concatenate([p.force for p in parts]),
            np.concatenate([p.valid for p in parts]),
            np.concatenate([p.arrival for p in parts]),
            np.concatenate([p.sync for p in parts]),
            np.concatenate([p.doubt for p in parts]),
        )

    def __len__(self) -> int:
        return len(self.time)

    def last(self, count: int) -> MoveSamples:
        """The last so many."""
        return MoveSamples(
            self.time[-count:], self.position[-count:], self.force[-count:], self.valid[-count:],
            self.arrival[-count:], self.sync[-count:], self.doubt[-count:],
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
        """With those invalid whose SYNC may have come noticeably sooner or later than usual.

        It came before its answer did, and where the host knows, before it had gone out for good.
        How far that bound is off its median is how far the sample may be off its instant: at
        10 mm/s, 10 us are 0.1 um, which looks like 2 N on 8 kg; with 15 us either way, estimates
        are off by more than they say.

        Args:
            period: Ts [s].
        """
        valid = self.valid.copy()
        for arrival, ok in zip(self.arrival.T, valid.T, strict=True):
            if ok.any():
                bound = np.fmin(arrival, self.doubt)
                away = np.abs(bound - np.median(bound[ok]))
                ok &= away <= PUNCTUAL * period
        return replace(self, valid=valid)

    def fresh(self) -> MoveSamples:
        """With those invalid that only repeat the one before, while the axis went on.

        A drive that sends old data sends position and force to the last bit as they were; then
        the position jumps.
        """
        valid = self.valid.copy()
        for position, force, ok in zip(self.position.T, self.force.T, valid.T, strict=True):
            rows = np.flatnonzero(ok)
            step = np.abs(np.diff(position[rows]))
            if not step.any():
                continue
            same = (step == 0.0) & (np.diff(force[rows]) == 0.0)
            jumped = step > STALE_STEPS * step[step > 0.0].min()
            # a run of repeats counts by the step that ends it
            ends = np.where(~same, np.arange(len(same)), len(same))
            ends = np.minimum.accumulate(ends[::-1])[::-1]
            stale = same & np.append(jumped, False)[ends]
            ok[rows[1:][stale]] = False
        return replace(self, valid=valid)

    def places(self, period: float) -> NDArray[np.int64]:
        """Of the SYNCs on the grid, counted from the first one's, shape (K,)."""
        return np.asarray(np.round((self.time - self.time[0]) / period), dtype=np.int64)

    def on_grid(self, period: float) -> MoveSamples:
        """With an invalid sample wherever a SYNC period was passed over."""
        place = self.places(period)
        if place[-1] == len(place) - 1:
            return self
        count, axes = int(place[-1]) + 1, self.position.shape[1]
        whole = MoveSamples(
            self.time[0] + period * np.arange(count), np.zeros((count, axes)),
            np.zeros((count, axes)), np.zeros((count, axes), dtype=np.bool_),
            np.full((count, axes), np.nan), np.zeros(count), np.zeros(count),
        )  # fmt: skip
        for name in ("position", "force", "valid", "arrival", "sync", "doubt"):
            getattr(whole, name)[place] = getattr(self, name)
        return whole

    def placed(self, period: float) -> MoveSamples:
        """As they would be had every SYNC left at its place; `on_grid` already.

        Position by the cubic through four samples around that instant, force by the line through
        two. What has no such neighbours is invalid, unless it hardly matters.

        Args:
            period: Ts [s].
        """
        if not self.valid.any():
            return self
        off = (self.sync - np.median(self.sync[self.valid.any(axis=1)])) / period
        moved = np.abs(off) > EXACT
        if not (moved[:, None] & self.valid).any():
            return self
        position, force, valid = self.position.copy(), self.force.copy(), self.valid.copy()
        valid[np.abs(off) > REACH] = False
        for a in range(position.shape[1]):
            rows = np.flatnonzero(valid[:, a])
            at = np.flatnonzero(moved[rows])
            if len(rows) < _NODES:
                valid[rows[at], a] = False
                continue
            first, near = _neighbours(rows, at, off[rows[at]] > 0)
            alone = rows[at[~near]]
            valid[alone[np.abs(off[alone]) > PUNCTUAL], a] = False
            at, first = at[near], first[near]
            here = rows[at]
            nodes = rows[first[:, None] + np.arange(_NODES)]
            position[here, a] = _through(
                nodes + off[nodes] - here[:, None], self.position[nodes, a]
            )
            two = np.clip(at - (off[here] > 0), 0, len(rows) - 2)
            nodes = rows[two[:, None] + np.arange(2)]
            force[here, a] = _through(nodes + off[nodes] - here[:, None], self.force[nodes, a])
        return replace(self, position=position, force=force, valid=valid)


def _neighbours(
    rows: NDArray[np.int64], at: NDArray[np.int64], before: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Where in `rows` the samples begin that each of `at` is read from, and if they are near.

    Args:
        rows: of valid samples, in order.
        at: which of them.
        before: whether its place is before it.
    """
    starts = np.clip(at[:, None] - np.arange(_NODES), 0, len(rows) - _NODES)
    spread = rows[starts + _NODES - 1] - rows[starts]
    aside = np.abs(at[:, None] - starts - 1 - before[:, None])
    best = np.argmin(spread + 0.1 * aside, axis=1)[:, None]
    first = np.take_along_axis(starts, best, axis=1)[:, 0]
    return first, np.take_along_axis(spread, best, axis=1)[:, 0] <= _SPREAD


def _through(place: F64, value: F64) -> F64:
    """At 0, the polynomials through values at places, both shape (m, nodes): shape (m,)."""
    origin = value[:, :1]
    total = origin[:, 0].copy()
    for i in range(place.shape[1]):
        weight = np.ones(len(place))
        for j in range(place.shape[1]):
            if j != i:
                weight *= place[:, j] / (place[:, j] - place[:, i])
        total += weight * (value[:, i] - origin[:, 0])
    return total
