"""The models of a faults file (`stagectl run --simulate --faults`): what fails, where and when.

They have exactly the keys of docs/faults.md; `stagectl.config.fault_plan` applies them to a
machine.
"""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from drivers.settings import HOST_NODE
from stagectl.config.parsing.units import Length, NotNegativeTime, Number, PositiveTime
from stagectl.config.parsing.validation import Section, refusal, suggest
from stagectl.config.parsing.yaml_nodes import describe_value

OF_HOST = {"nmt": 0x000, "sync": 0x080, "host_heartbeat": 0x700 + HOST_NODE}
TO_NODE = {"rpdo1": 0x200, "rpdo2": 0x300, "rpdo3": 0x400, "rpdo4": 0x500, "sdo_request": 0x600}
OF_NODE = {
    "emcy": 0x080, "tpdo1": 0x180, "tpdo2": 0x280, "tpdo3": 0x380, "tpdo4": 0x480,
    "sdo_answer": 0x580, "heartbeat": 0x700,
}  # fmt: skip
ANY = ("from_host", "from_drives", "any")
FRAME_NAMES = (*OF_HOST, *TO_NODE, *OF_NODE, *ANY)
_ID = re.compile(r"0x[0-9a-fA-F]{1,3}\Z")
_OBJECT = re.compile(r"0x[0-9a-fA-F]{4}\Z")
_CODE = re.compile(r"0x[0-9a-fA-F]{1,8}\Z")
HOST = "host"
LATEST = 1e9
"""Latest time of a fault [s], well within integer nanoseconds."""


def _frame(value: object) -> object:
    if isinstance(value, str) and _ID.match(value) and int(value, 16) <= 0x7FF:
        return value
    if value not in FRAME_NAMES:
        hint = suggest(str(value), list(FRAME_NAMES))
        is_what = f"is {describe_value(value)}{hint}"
        raise refusal(f"must be the name of a frame, or an id such as '0x181'; {is_what}")
    return value


def _hexadecimal(pattern: re.Pattern[str], example: str) -> BeforeValidator:
    def convert(value: object) -> int:
        if not (isinstance(value, str) and pattern.match(value)):
            raise refusal(f"must be a text such as '{example}', is {describe_value(value)}")
        return int(value, 16)

    return BeforeValidator(convert)


def _list(value: object) -> object:
    ids = [value] if isinstance(value, int) and not isinstance(value, bool) else value
    return tuple(ids) if isinstance(ids, list) else ids


Positive = Annotated[int, Field(ge=1)]
FrameName = Annotated[str, BeforeValidator(_frame)]
Occurrences = Annotated[tuple[Positive, ...], BeforeValidator(_list)]
Probability = Annotated[Number, Field(gt=0, le=1)]
Moment = Annotated[NotNegativeTime, Field(le=LATEST)]
Span = Annotated[PositiveTime, Field(le=LATEST)]


class Window(Section):
    """When and how often a fault of frames occurs."""

    after: Moment = 0.0
    until: Span | None = None
    nth: Occurrences = ()
    probability: Probability = 1.0
    at_most: Positive | None = None


class OnFrames(Window):
    """Faults of named frames."""

    frame: FrameName
    axis: str | None = None


class Drop(OnFrames):
    """`fault: drop`."""

    fault: Literal["drop"]


class Duplicate(OnFrames):
    """`fault: duplicate`."""

    fault: Literal["duplicate"]
    copies: Annotated[int, Field(ge=1, le=100)] = 1


class Delay(OnFrames):
    """`fault: delay`."""

    fault: Literal["delay"]
    least: Moment = 0.0
    most: Span


class Reorder(OnFrames):
    """`fault: reorder`."""

    fault: Literal["reorder"]
    hold: Span = 1e-3


class Resize(OnFrames):
    """`fault: resize`."""

    fault: Literal["resize"]
    length: Annotated[int, Field(ge=0, le=8)]


class Freeze(OnFrames):
    """`fault: freeze`."""

    fault: Literal["freeze"]


class SyncJitter(Window):
    """`fault: sync_jitter`."""

    fault: Literal["sync_jitter"]
    most: Span


class SyncMiss(Window):
    """`fault: sync_miss`."""

    fault: Literal["sync_miss"]
    axis: str | None = None


class HeartbeatSilence(Section):
    """`fault: heartbeat_silence`."""

    fault: Literal["heartbeat_silence"]
    of: str
    after: Moment
    until: Span | None = None


class BusOff(Section):
    """`fault: bus_off`."""

    fault: Literal["bus_off"]
    of: str
    at: Moment
    duration: Span


class Reboot(Section):
    """`fault: reboot`."""

    fault: Literal["reboot"]
    axis: str
    at: Moment


class SdoAbort(Section):
    """`fault: sdo_abort`."""

    fault: Literal["sdo_abort"]
    axis: str
    nth: Positive = 1
    times: Positive = 1
    code: Annotated[int, _hexadecimal(_CODE, "0x08000000")] = 0x08000000
    object: Annotated[int, _hexadecimal(_OBJECT, "0x6060")] | None = None
    after: Moment = 0.0


class DriveFault(Section):
    """`fault: drive`."""

    fault: Literal["drive"]
    axis: str
    error: Literal[
        "over_current", "encoder_loss", "under_voltage", "over_travel", "following_error",
        "over_voltage", "over_temperature", "hardware",
    ]  # fmt: skip
    at: Moment | None = None
    position: Length | None = None
    until: Moment | None = None


class SafeTorqueOff(Section):
    """`fault: sto`."""

    fault: Literal["sto"]
    axis: str
    at: Moment
    until: Moment | None = None


FaultSection = Annotated[
    Drop | Duplicate | Delay | Reorder | Resize | Freeze | SyncJitter | SyncMiss
    | HeartbeatSilence | BusOff | Reboot | SdoAbort | DriveFault
    | SafeTorqueOff,
    Field(discriminator="fault"),
]  # fmt: skip


class FaultsFile(Section):
    """A whole faults file."""

    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    faults: Annotated[list[FaultSection], Field(min_length=1, max_length=1000)]
