"""Faults of bus and drives, as frozen settings; `fault_world.FaultyWorld` lets them occur.

Times are virtual, in seconds from the power-on of the virtual stage. Node ids and CAN-IDs are those
on the bus. Each fault draws its random numbers from a stream of its own, seeded by the plan: adding
a fault does not change what the others do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from hil_sim.cia301 import (
    ENCODER_LOST,
    FOLLOWING_ERROR,
    HARDWARE,
    OVER_CURRENT,
    OVER_TEMPERATURE,
    OVER_TRAVEL,
    OVER_VOLTAGE,
    UNDER_VOLTAGE,
)

DRIVE_FAULTS: dict[str, int] = {
    "over_current": OVER_CURRENT,
    "encoder_loss": ENCODER_LOST,
    "under_voltage": UNDER_VOLTAGE,
    "over_travel": OVER_TRAVEL,
    "following_error": FOLLOWING_ERROR,
    "over_voltage": OVER_VOLTAGE,
    "over_temperature": OVER_TEMPERATURE,
    "hardware": HARDWARE,
}
"""Names of drive faults and their error codes (CiA 402, 0x603F)."""

GENERAL_ABORT = 0x08000000

Sender = Literal["host", "drives"]


def _check(condition: bool, name: str, reason: str) -> None:
    if not condition:
        raise ValueError(f"{name}: {reason}")


def _check_time(value: float, name: str) -> None:
    _check(math.isfinite(value) and value >= 0, name, f"must be >= 0, is {value!r}")


@dataclass(frozen=True, slots=True)
class Frames:
    """Which frames a fault acts on: those that meet all of these conditions.

    Attributes:
        ids: CAN-IDs, None for any.
        sender: "host" or "drives", None for both.
        node: with sender "drives", the node that sends the frame. With "host", the one node whose
            reception is affected; the others receive the frame as it was sent.
        after, until: window of time [s]; `until` itself is outside.
        nth: which frames of those that meet the conditions above, counted from 1; empty for all.
        probability: of the fault for each of these.
        at_most: number of frames affected, None for any.
    """

    ids: frozenset[int] | None = None
    sender: Sender | None = None
    node: int | None = None
    after: float = 0.0
    until: float = math.inf
    nth: frozenset[int] = frozenset()
    probability: float = 1.0
    at_most: int | None = None

    def __post_init__(self) -> None:
        _check_time(self.after, "after")
        _check(self.until > self.after, "until", f"must be > after, is {self.until!r}")
        _check(0 < self.probability <= 1, "probability", "must be in (0, 1]")
        _check(all(n >= 1 for n in self.nth), "nth", "counts from 1")
        _check(self.at_most is None or self.at_most >= 1, "at_most", "must be >= 1")
        _check(self.node is None or self.sender is not None, "node", "needs sender")


@dataclass(frozen=True, slots=True)
class Drop:
    """The frame is lost."""

    frames: Frames


@dataclass(frozen=True, slots=True)
class Duplicate:
    """The frame is repeated at once, `copies` times."""

    frames: Frames
    copies: int = 1

    def __post_init__(self) -> None:
        _check(1 <= self.copies <= 100, "copies", f"must be 1..100, is {self.copies!r}")


@dataclass(frozen=True, slots=True)
class Delay:
    """The frame is late by a time [s] drawn uniformly between `least` and `most`."""

    frames: Frames
    least: float
    most: float

    def __post_init__(self) -> None:
        _check_time(self.least, "least")
        _check(math.isfinite(self.most) and self.most >= self.least, "most", "must be >= least")


@dataclass(frozen=True, slots=True)
class Reorder:
    """The frame arrives after the next one of its direction, or after `hold` [s]."""

    frames: Frames
    hold: float = 1e-3

    def __post_init__(self) -> None:
        _check(math.isfinite(self.hold) and self.hold > 0, "hold", "must be > 0")


@dataclass(frozen=True, slots=True)
class Resize:
    """The frame arrives with this length [bytes], truncated or padded with zeros."""

    frames: Frames
    length: int

    def __post_init__(self) -> None:
        _check(0 <= self.length <= 8, "length", f"must be 0..8, is {self.length!r}")


@dataclass(frozen=True, slots=True)
class Freeze:
    """The frame carries the data of the last frame with its id before the fault."""

    frames: Frames


@dataclass(frozen=True, slots=True)
class SdoAbort:
    """SDO accesses to a node are aborted; the node never sees them.

    Attributes:
        node: of the server.
        nth: the first access aborted, counted from 1.
        times: how many in a row.
        code: abort code.
        index: object, None for any.
        after: accesses before this time are not counted [s].
    """

    node: int
    nth: int = 1
    times: int = 1
    code: int = GENERAL_ABORT
    index: int | None = None
    after: float = 0.0

    def __post_init__(self) -> None:
        _check(self.nth >= 1, "nth", "counts from 1")
        _check(self.times >= 1, "times", "must be >= 1")
        _check(0 <= self.code < 1 << 32, "code", "must be UNSIGNED32")
        _check_time(self.after, "after")


@dataclass(frozen=True, slots=True)
class BusOff:
    """A CAN controller is bus-off for some time: it neither sends nor receives.

    A drive announces its return (EMCY 0x8140). At the host, sending is an error meanwhile.

    Attributes:
        node: of the controller, None for the host's.
        at, duration: [s].
    """

    node: int | None
    at: float
    duration: float

    def __post_init__(self) -> None:
        _check_time(self.at, "at")
        _check(self.duration > 0, "duration", "must be > 0")


@dataclass(frozen=True, slots=True)
class Reboot:
    """A drive restarts at `at` [s], as by its watchdog: force off, parameters lost."""

    node: int
    at: float

    def __post_init__(self) -> None:
        _check_time(self.at, "at")


@dataclass(frozen=True, slots=True)
class DriveFault:
    """A fault inside a drive, either at a time or at a position.

    Attributes:
        node: of the drive.
        code: error code, 0x603F.
        at: time [s].
        position: the fault occurs once, when 0x6064 crosses this [m] while the drive follows
            setpoints in a cyclic mode; checked every millisecond.
        until: the cause remains until then [s], and a reset is refused; None: it is momentary.
    """

    node: int
    code: int
    at: float | None = None
    position: float | None = None
    until: float | None = None

    def __post_init__(self) -> None:
        _check(0 < self.code <= 0xFFFF, "code", f"must be 0x0001..0xFFFF, is {self.code:#x}")
        _check(
            (self.at is None) != (self.position is None), "at", "needs either a time or a position"
        )
        if self.at is not None:
            _check_time(self.at, "at")
        if self.until is not None:
            _check(self.until > (self.at or 0.0), "until", f"must be > at, is {self.until!r}")


@dataclass(frozen=True, slots=True)
class SafeTorqueOff:
    """A drive's STO input becomes active, as by an emergency stop or a door.

    Attributes:
        node: of the drive.
        at: time [s].
        until: it stays active until then [s]; None: to the end.
    """

    node: int
    at: float
    until: float | None = None

    def __post_init__(self) -> None:
        _check_time(self.at, "at")
        if self.until is not None:
            _check(self.until > self.at, "until", f"must be > at, is {self.until!r}")


FrameFault = Drop | Duplicate | Delay | Reorder | Resize | Freeze
Fault = FrameFault | SdoAbort | BusOff | Reboot | DriveFault | SafeTorqueOff


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """The faults of a run.

    Attributes:
        faults: in the order in which they act on a frame.
        seed: of their random numbers.
    """

    faults: tuple[Fault, ...] = field(default=())
    seed: int = 0
