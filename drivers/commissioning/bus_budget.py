"""Whether a set of CAN 2.0A frames fits into the SYNC period, with worst-case bit stuffing.

A data frame of n bytes has 47 + 8 n bits, interframe space included, and at most
floor((34 + 8 n - 1) / 4) stuff bits: of the 34 + 8 n bits that are stuffed, one after the first
five and one after every further four.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

SDO_BYTES = 8
HEARTBEAT_PERIOD = 0.1
"""Of the host and of every node [s] (`AxisSettings.heartbeat` by default, `bus.HEARTBEAT_NS`)."""


def least_bits(data_bytes: int) -> int:
    """Bits of a data frame without stuffing.

    Raises:
        ValueError: not 0..8 bytes.
    """
    if not 0 <= data_bytes <= 8:
        raise ValueError(f"a CAN frame has 0 to 8 bytes, not {data_bytes}")
    return 47 + 8 * data_bytes


def worst_bits(data_bytes: int) -> int:
    """Bits of a data frame with as many stuff bits as possible."""
    return least_bits(data_bytes) + (34 + 8 * data_bytes - 1) // 4


@dataclass(frozen=True, slots=True)
class Line:
    """A frame of every cycle.

    Attributes:
        name: such as "RPDO 1 of x".  data_bytes: of the frame.
    """

    name: str
    data_bytes: int

    @property
    def worst(self) -> int:
        """Its bits, worst stuffing."""
        return worst_bits(self.data_bytes)

    @property
    def least(self) -> int:
        """Its bits, no stuffing."""
        return least_bits(self.data_bytes)


@dataclass(frozen=True, slots=True)
class BusBudget:
    """Bus time of one SYNC period.

    Attributes:
        lines: frames of every cycle.
        heartbeats: nodes that send one every `HEARTBEAT_PERIOD`, host included.
        sync_period: [s].  bitrate: [bit/s].
    """

    lines: tuple[Line, ...]
    heartbeats: int
    sync_period: float
    bitrate: int

    @property
    def available(self) -> int:
        """Bits available in a cycle."""
        # the factor keeps rounding of 0.001 * 1e6 from losing one bit
        return math.floor(self.sync_period * self.bitrate * (1 + 1e-9))

    @property
    def worst(self) -> int:
        """Bits of the cyclic frames, worst stuffing."""
        return sum(line.worst for line in self.lines)

    @property
    def least(self) -> int:
        """Bits of the cyclic frames, no stuffing."""
        return sum(line.least for line in self.lines)

    @property
    def peak(self) -> int:
        """Bits of the worst cycle, with every heartbeat that can fall into it."""
        in_one = math.ceil(self.sync_period / HEARTBEAT_PERIOD)
        return self.worst + self.heartbeats * in_one * worst_bits(1)

    @property
    def fits(self) -> bool:
        """Whether the cyclic frames and all heartbeats fit into the worst cycle."""
        return self.peak <= self.available

    @property
    def sdo_pairs(self) -> int:
        """SDO request and answer pairs that still fit into the worst cycle."""
        return max(0, self.available - self.peak) // (2 * worst_bits(SDO_BYTES))

    @property
    def shortest_period(self) -> float:
        """The shortest SYNC period that these frames and heartbeats fit into [s]."""
        return (self.worst + self.heartbeats * worst_bits(1)) / self.bitrate

    @property
    def sdo_per_second(self) -> float:
        """SDO request and answer pairs per second that fit on average, heartbeats included."""
        beats = self.heartbeats * worst_bits(1) / HEARTBEAT_PERIOD
        left = self.bitrate - self.worst / self.sync_period - beats
        return max(0.0, left / (2 * worst_bits(SDO_BYTES)))


def stage_budget(
    axes: tuple[str, ...],
    rpdos: tuple[int, ...],
    tpdos: tuple[int, ...],
    sync_period: float,
    bitrate: int,
    sync_bytes: int = 0,
) -> BusBudget:
    """The budget of a stage: SYNC, and the same PDOs for every axis.

    Args:
        axes: names of the axes.
        rpdos: bytes of each RPDO of an axis.
        tpdos: bytes of each TPDO of an axis.
        sync_period: [s].
        bitrate: [bit/s].
        sync_bytes: 1 where SYNC carries a counter.

    Raises:
        ValueError: a PDO has more than 8 bytes.
    """
    lines = [Line("SYNC", sync_bytes)]
    for name in axes:
        lines += [Line(f"RPDO {n} of {name}", b) for n, b in enumerate(rpdos, start=1)]
        lines += [Line(f"TPDO {n} of {name}", b) for n, b in enumerate(tpdos, start=1)]
    for line in lines:
        least_bits(line.data_bytes)
    return BusBudget(tuple(lines), len(axes) + 1, sync_period, bitrate)
