"""Faults files (`stagectl run --simulate --faults`): what fails, where and when.

The sections have exactly the keys of docs/how-to/faults.md. For a machine they become the
simulator's faults: names of axes and frames are made node ids and CAN-IDs of the predefined
connection set of CiA 301.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from drivers.settings import HOST_NODE
from hil_sim.bus import faults as sim
from stagectl.config.machine import Machine
from stagectl.config.parsing.units import Length, NotNegativeTime, Number, PositiveTime
from stagectl.config.parsing.validation import Section, refusal, sort_problems, suggest, validate
from stagectl.config.parsing.yaml_nodes import (
    Document,
    describe_value,
    load_document,
    parse_document,
)
from stagectl.errors import ConfigError

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


Nodes = Mapping[str, int]
"""Axis -> node id."""


class Window(Section):
    """When and how often a fault of frames occurs."""

    after: Moment = 0.0
    until: Span | None = None
    nth: Occurrences = ()
    probability: Probability = 1.0
    at_most: Positive | None = None

    def frames_named(self, frame: str, axis: str | None, nodes: Nodes) -> sim.Frames:
        """The frames of this name, of all axes or one, in the window."""
        node = None if axis is None else _node(axis, nodes)
        ids: frozenset[int] | None = None
        sender: sim.Sender | None = "drives" if frame in ("from_drives", *OF_NODE) else "host"
        if frame in OF_HOST:
            ids = frozenset({OF_HOST[frame]})
        elif frame in TO_NODE or frame in OF_NODE:
            base = TO_NODE.get(frame) or OF_NODE[frame]
            ids = frozenset(base + n for n in (nodes.values() if node is None else [node]))
            node = None
        elif frame == "any":
            sender = None
        elif frame not in ANY:
            ids, sender = frozenset({int(frame, 16)}), None
        return sim.Frames(
            ids, sender, node, self.after, _end(self.until), frozenset(self.nth),
            self.probability, self.at_most,
        )  # fmt: skip


class OnFrames(Window):
    """Faults of named frames."""

    frame: FrameName
    axis: str | None = None

    def frames(self, nodes: Nodes) -> sim.Frames:
        """The frames that the fault acts on."""
        return self.frames_named(self.frame, self.axis, nodes)


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
    code: Annotated[int, _hexadecimal(_CODE, "0x08000000")] = sim.GENERAL_ABORT
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


def load_faults(path: Path | str, machine: Machine, seed: int) -> sim.FaultPlan:
    """The faults of a file, for a machine.

    Args:
        path: of the file.
        machine: its axes can be named.
        seed: used unless the file has one.

    Raises:
        ConfigError: the file cannot be used; one line per problem.
    """
    return _plan(load_document(path), machine, seed)


def parse_faults(text: str, name: str, machine: Machine, seed: int) -> sim.FaultPlan:
    """The faults of a text, which messages call `name`.

    Raises:
        ConfigError: as `load_faults`.
    """
    return _plan(parse_document(text, name), machine, seed)


def _plan(document: Document, machine: Machine, seed: int) -> sim.FaultPlan:
    file = validate(document, FaultsFile)
    nodes = {name: axis.node for name, axis in machine.axes.items()}
    faults: list[sim.Fault] = []
    problems: list[str] = []
    for index, section in enumerate(file.faults):
        try:
            faults.append(_fault(section, nodes))
        except ValueError as error:
            key, _, reason = str(error).partition(": ")
            problems.append(document.problem(("faults", index, key), reason))
    if problems:
        raise ConfigError(sort_problems(problems))
    return sim.FaultPlan(tuple(faults), seed if file.seed is None else file.seed)


def _fault(section: FaultSection, nodes: Nodes) -> sim.Fault:
    """The simulator's fault.

    Raises:
        ValueError: `key: reason`, where values do not fit each other or the machine.
    """
    match section:
        case OnFrames():  # the simulator's fault of the same name has the same figures
            kind: type[sim.FrameFault] = getattr(sim, type(section).__name__)
            own = section.model_dump(exclude={"fault", *OnFrames.model_fields})
            return kind(section.frames(nodes), **own)
        case SyncJitter():
            return sim.Delay(section.frames_named("sync", None, nodes), 0.0, section.most)
        case SyncMiss():
            return sim.Drop(section.frames_named("sync", section.axis, nodes))
        case HeartbeatSilence(of=of):
            ids = frozenset({0x700 + (HOST_NODE if of == HOST else _node(of, nodes, "of"))})
            return sim.Drop(sim.Frames(ids, after=section.after, until=_end(section.until)))
        case BusOff(of=of):
            node = None if of == HOST else _node(of, nodes, "of")
            return sim.BusOff(node, section.at, section.duration)
        case Reboot():
            return sim.Reboot(_node(section.axis, nodes), section.at)
        case SdoAbort():
            return sim.SdoAbort(
                _node(section.axis, nodes), section.nth, section.times, section.code,
                section.object, section.after,
            )  # fmt: skip
        case DriveFault():
            return sim.DriveFault(
                _node(section.axis, nodes), sim.DRIVE_FAULTS[section.error], section.at,
                section.position, section.until,
            )  # fmt: skip
        case SafeTorqueOff():
            return sim.SafeTorqueOff(_node(section.axis, nodes), section.at, section.until)


def _node(axis: str, nodes: Nodes, key: str = "axis") -> int:
    if axis not in nodes:
        known = [*nodes, *([HOST] if key == "of" else [])]
        raise ValueError(f"{key}: no such axis in the machine{suggest(axis, known)}")
    return nodes[axis]


def _end(until: float | None) -> float:
    return math.inf if until is None else until
