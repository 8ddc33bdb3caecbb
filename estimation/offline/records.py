"""Prepares samples for the off-line fit: joined, differentiated, cut into blocks at rests.

A record is one axis over any number of moves without a gap. At its start and after a hole the
element forces are unknown until the axis has slid far enough for all elements to slip: those
samples drive the model, but do not count. Samples at rest do not count either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.kinematics import differences
from stagedata import F64
from stagedata.compiled import kernel

BLOCK = 0.25
"""A block ends at the first rest after this time [s] ..."""
REST = 0.01
"""Shortest rest at which a block may end [s]."""
LONGEST = 0.6
"""... and at the latest after this time, at rest or not [s]."""
HOLE = 5
"""After this many samples without position the state of the elements is unknown."""


@dataclass(frozen=True, slots=True)
class OfflineSettings:
    """How an axis is identified.

    Attributes:
        mass: moved mass [kg].
        period: of the samples [s].
        position_noise: rms of a sampled position, encoder increment included [m].
        force_noise: rms of a sampled force, its resolution included [N].
        peak_force: samples at or beyond it are left out [N].
        wander: rms of the level.  correlation_time: of it [s].
        model_error: rms of what the model itself misses, relative to the Coulomb force.
        misfit: largest rms of the whitened residual that is accepted.
        least: fewest samples in motion.
    """

    mass: float
    period: float
    position_noise: float
    force_noise: float
    peak_force: float = math.inf
    wander: float = 0.01
    correlation_time: float = 0.5
    model_error: float = 0.003
    misfit: float = 3.0
    least: int = 300


@dataclass(frozen=True, slots=True)
class Samples:
    """One axis over one or more moves, from rest.

    Attributes:
        position: sampled [m], shape (K,).
        force: measured at the same instants [N], shape (K,).
        valid: samples to be used, shape (K,).
        time: of position[0] [s].
        demand: target position sent for each sample [m], shape (K,); None where not known.

    Raises:
        ValueError: shapes that differ, or fewer than three samples that can be used.
    """

    position: F64
    force: F64
    valid: NDArray[np.bool_]
    time: float
    demand: F64 | None = None

    def __post_init__(self) -> None:
        others = (self.force, self.valid, *(() if self.demand is None else (self.demand,)))
        if any(a.shape != self.position.shape for a in others):
            raise ValueError("position, force, valid and demand must have the same length")
        if self.usable.sum() < 3:
            raise ValueError("fewer than three valid samples")

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Valid and finite."""
        result: NDArray[np.bool_] = (
            self.valid & np.isfinite(self.position) & np.isfinite(self.force)
        )
        return result


@dataclass(frozen=True, slots=True)
class Record:
    """One axis over consecutive moves; M = K - 2 inner samples.

    Attributes:
        position, force: sampled [m, N], shape (K,).
        velocity, acceleration: at the inner samples, shape (M,).
        ripple: second difference of the setpoints one sample back, its change and its curvature
            [m/s^2], shape (M, 3).
        used: inner samples that count, shape (M,).
        blocks: (first, one past last) inner sample of each block.
    """

    position: F64
    force: F64
    velocity: F64
    acceleration: F64
    ripple: F64
    used: NDArray[np.bool_]
    blocks: tuple[tuple[int, int], ...]


def joined(pieces: Sequence[Samples], period: float) -> list[Samples]:
    """Join pieces that follow one another without a gap; overlapping samples count once."""
    result: list[Samples] = []
    for piece in pieces:
        if result:
            last = result[-1]
            # Sample of the last piece that this one's first is.
            place = round((piece.time - last.time) / period)
            if 0 < place <= len(last.position) and (last.demand is None) == (piece.demand is None):
                result[-1] = Samples(
                    np.concatenate([last.position[:place], piece.position]),
                    np.concatenate([last.force[:place], piece.force]),
                    np.concatenate([last.valid[:place], piece.valid]),
                    last.time,
                    None
                    if last.demand is None or piece.demand is None
                    else np.concatenate([last.demand[:place], piece.demand]),
                )
                continue
        result.append(piece)
    return result


def record(samples: Samples, settings: OfflineSettings, travel: float) -> Record:
    """Make a record of samples without a gap.

    Args:
        samples: any number of moves.
        settings: of the identification.
        travel: motion in one direction after which all elements slip [m].
    """
    valid, period = samples.usable, settings.period
    index = np.arange(len(valid))
    position = np.interp(index, index[valid], samples.position[valid])
    force = np.where(valid, samples.force, 0.0)
    count = len(valid) - 2
    velocity, acceleration = np.empty(count), np.empty(count)
    used = np.empty(count, dtype=np.bool_)
    differences(position, valid, period, velocity, acceleration, used)
    band = 6.0 * math.sqrt(2.0) * settings.position_noise
    moving = np.abs(position[2:] - position[:-2]) > band
    moving = np.convolve(moving, np.ones(5), mode="same") > 0.5  # two samples around it too
    used &= moving & (np.abs(force[1:-1]) < settings.peak_force)
    holes = np.convolve(~valid[1:-1], np.ones(HOLE), mode="full")[:count] > HOLE - 0.5
    used &= _known(position[1:-1], holes, travel)
    return Record(
        position, force, velocity, acceleration, _ripple(samples.demand, acceleration, period),
        used, tuple(_blocks(moving, period)),
    )  # fmt: skip


def _ripple(demand: F64 | None, acceleration: F64, period: float) -> F64:
    """Second difference one sample back, its change over two samples, its curvature, (M, 3)."""
    if demand is None:
        result = np.zeros((len(acceleration), 3))
        result[:, 1] = 0.5 * (np.roll(acceleration, -1) - np.roll(acceleration, 1))
        result[[0, -1]] = 0.0
        return result
    now = np.diff(demand, 2) / period**2
    back = np.concatenate([np.zeros(1), now[:-1]])
    older = np.concatenate([np.zeros(2), now[:-2]])[: len(now)]
    return np.column_stack([back, 0.5 * (now - older), now - 2.0 * back + older])


@kernel()
def _known(position, holes, travel):  # type: ignore[no-untyped-def]
    """Whether all elements have slipped since the start or the last hole, shape (M,).

    `position` [m] and `holes`, shapes (M,); `travel`: in one direction after which all slip [m].
    """
    count = position.shape[0]
    known = np.zeros(count, dtype=np.bool_)
    now = False
    low = high = position[0]
    for k in range(count):
        if holes[k]:
            now = False
            low = high = position[k]
        # The span since a reversal: a running extreme that motion away from it keeps.
        if position[k] - low > travel or high - position[k] > travel:
            now = True
        if now:
            low = high = position[k]
        low, high = min(low, position[k]), max(high, position[k])
        known[k] = now
    return known


def _blocks(moving: NDArray[np.bool_], period: float) -> list[tuple[int, int]]:
    """Cut at rests into pieces of at least BLOCK seconds."""
    count = len(moving)
    least, longest, rest = round(BLOCK / period), round(LONGEST / period), round(REST / period)
    blocks, begin, still = [], 0, 0
    for k in range(count):
        still = 0 if moving[k] else still + 1
        # At the end of a rest: what follows begins with its motion.
        ends = still >= rest and k + 1 < count and moving[k + 1] and k + 1 - begin >= least
        if ends or k + 1 - begin >= longest:
            blocks.append((begin, k + 1))
            begin = k + 1
    if count - begin > 2:
        blocks.append((begin, count))
    return blocks
