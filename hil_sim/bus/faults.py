"""Faults of bus and drives, as frozen settings; `fault_world.FaultyWorld` lets them occur.

Times are virtual, in seconds from the power-on of the virtual stage. Node ids and CAN-IDs are those
on the bus. Each fault draws its random numbers from a stream of its own, seeded by the plan: adding
a fault does not change what the others do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Gt, Interval, Le

from hil_sim.cia301 import emergency
from stagedata.ranges import Count, NotNegative, Positive, check_ranges

DRIVE_FAULTS: dict[str, int] = {
    "over_current": emergency.OVER_CURRENT,
    "encoder_loss": emergency.ENCODER_LOST,
    "under_voltage": emergency.UNDER_VOLTAGE,
    "over_travel": emergency.OVER_TRAVEL,
    "following_error": emergency.FOLLOWING_ERROR,
    "over_voltage": emergency.OVER_VOLTAGE,
    "over_temperature": emergency.OVER_TEMPERATURE,
    "hardware": emergency.HARDWARE,
}
"""Names of drive faults and their error codes (CiA 402, 0x603F)."""

GENERAL_ABORT = 0x08000000

Sender = Literal["host", "drives"]


class _Checked:
    """Refuses figures outside the ranges in their annotations."""

    __slots__ = ()

    def __post_init__(self) -> None:
        check_ranges(self)


def _check_end(until: float | None, begin: float, name: str) -> None:
    if until is not None and not until > begin:
        raise ValueError(f"until: must be later than {name}")


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
    after: NotNegative = 0.0
    until: float = math.inf
    nth: frozenset[int] = frozenset()
    probability: Annotated[float, Gt(0), Le(1)] = 1.0
    at_most: Count | None = None

    def __post_init__(self) -> None:
        check_ranges(self)
        _check_end(self.until, self.after, f"after, {self.after:g} s")
        if min(self.nth, default=1) < 1:
            raise ValueError("nth: counts from 1")
        if self.node is not None and self.sender is None:
            raise ValueError("axis: needs a frame with a known sender")


@dataclass(frozen=True, slots=True)
class Drop:
    """The frame is lost."""

    frames: Frames


@dataclass(frozen=True, slots=True)
class Duplicate(_Checked):
    """The frame is repeated at once, `copies` times."""

    frames: Frames
    copies: Annotated[int, Interval(ge=1, le=100)] = 1


@dataclass(frozen=True, slots=True)
class Delay:
    """The frame is late by a time [s] drawn uniformly between `least` and `most`."""

    frames: Frames
    least: NotNegative
    most: NotNegative

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.least > self.most:
            raise ValueError(f"least: is more than most, {self.most:g} s")


@dataclass(frozen=True, slots=True)
class Reorder(_Checked):
    """The frame arrives after the next one of its direction, or after `hold` [s]."""

    frames: Frames
    hold: Positive = 1e-3


@dataclass(frozen=True, slots=True)
class Resize(_Checked):
    """The frame arrives with this length [bytes], truncated or padded with zeros."""

    frames: Frames
    length: Annotated[int, Interval(ge=0, le=8)]


@dataclass(frozen=True, slots=True)
class Freeze:
    """The frame carries the data of the last frame with its id before the fault."""

    frames: Frames


@dataclass(frozen=True, slots=True)
class SdoAbort(_Checked):
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
    nth: Count = 1
    times: Count = 1
    code: Annotated[int, Interval(ge=0, le=0xFFFF_FFFF)] = GENERAL_ABORT
    index: int | None = None
    after: NotNegative = 0.0


@dataclass(frozen=True, slots=True)
class BusOff(_Checked):
    """A CAN controller is bus-off for some time: it neither sends nor receives.

    A drive announces its return (EMCY 0x8140). At the host, sending is an error meanwhile.

    Attributes:
        node: of the controller, None for the host's.
        at, duration: [s].
    """

    node: int | None
    at: NotNegative
    duration: Positive


@dataclass(frozen=True, slots=True)
class Reboot(_Checked):
    """A drive restarts at `at` [s], as by its watchdog: force off, parameters lost."""

    node: int
    at: NotNegative


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
    code: Annotated[int, Interval(ge=1, le=0xFFFF)]
    at: NotNegative | None = None
    position: float | None = None
    until: float | None = None

    def __post_init__(self) -> None:
        check_ranges(self)
        if (self.at is None) == (self.position is None):
            raise ValueError("at: needs either at or position")
        _check_end(self.until, self.at or 0.0, "at")


@dataclass(frozen=True, slots=True)
class SafeTorqueOff:
    """A drive's STO input becomes active, as by an emergency stop or a door.

    Attributes:
        node: of the drive.
        at: time [s].
        until: it stays active until then [s]; None: to the end.
    """

    node: int
    at: NotNegative
    until: float | None = None

    def __post_init__(self) -> None:
        check_ranges(self)
        _check_end(self.until, self.at, "at")


FrameFault = Drop | Duplicate | Delay | Reorder | Resize | Freeze
Fault = FrameFault | SdoAbort | BusOff | Reboot | DriveFault | SafeTorqueOff


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """The faults of a run.

    Attributes:
        faults: in the order in which they act on a frame.
        seed: of their random numbers.
    """

    faults: tuple[Fault, ...] = ()
    seed: int = 0
