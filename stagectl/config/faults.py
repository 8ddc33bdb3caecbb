"""The faults file of `stagectl run --simulate --faults`: what is to go wrong, on which axis, when.

Keys and examples: docs/faults.md. The models hold exactly these keys; `load_faults` turns axis
names and frame names into the node ids and CAN-IDs of the machine (predefined connection set of
CiA 301, which drivers and virtual drives use) and gives the simulator's `FaultPlan`.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator, Field, StrictInt
from pydantic_core import PydanticCustomError

from drivers.settings import HOST_NODE
from stagectl.config.diagnose import Section, in_order, suggestion, validate
from stagectl.config.machine import Machine
from stagectl.config.units import Length, NotNegativeTime, Number, PositiveTime
from stagectl.config.yaml_nodes import Document, load_document, parse_document, shown
from stagectl.errors import ConfigError

if TYPE_CHECKING:
    from hil_sim import faults as sim

_OF_HOST = {"nmt": 0x000, "sync": 0x080, "host_heartbeat": 0x700 + HOST_NODE}
_TO_NODE = {"rpdo1": 0x200, "rpdo2": 0x300, "rpdo3": 0x400, "rpdo4": 0x500, "sdo_request": 0x600}
_OF_NODE = {
    "emcy": 0x080, "tpdo1": 0x180, "tpdo2": 0x280, "tpdo3": 0x380, "tpdo4": 0x480,
    "sdo_answer": 0x580, "heartbeat": 0x700,
}  # fmt: skip
_ANY = ("from_host", "from_drives", "any")
FRAME_NAMES = (*_OF_HOST, *_TO_NODE, *_OF_NODE, *_ANY)
_ID = re.compile(r"0x[0-9a-fA-F]{1,3}\Z")
_OBJECT = re.compile(r"0x[0-9a-fA-F]{4}\Z")
_CODE = re.compile(r"0x[0-9a-fA-F]{1,8}\Z")
HOST = "host"


def _refuse(reason: str) -> PydanticCustomError:
    return PydanticCustomError("reason", "{reason}", {"reason": reason})


def _frame(value: object) -> object:
    if isinstance(value, str) and _ID.match(value) and int(value, 16) <= 0x7FF:
        return value
    if value not in FRAME_NAMES:
        hint = suggestion(str(value), list(FRAME_NAMES))
        raise _refuse(
            f"must be the name of a frame, or an id such as '0x181'; is {shown(value)}{hint}"
        )
    return value


def _hexadecimal(pattern: re.Pattern[str], example: str) -> BeforeValidator:
    def convert(value: object) -> int:
        if not (isinstance(value, str) and pattern.match(value)):
            raise _refuse(f"must be a text such as '{example}', is {shown(value)}")
        return int(value, 16)

    return BeforeValidator(convert)


def _list(value: object) -> object:
    return [value] if isinstance(value, int) and not isinstance(value, bool) else value


Positive = Annotated[StrictInt, Field(ge=1)]
FrameName = Annotated[str, BeforeValidator(_frame)]
Occurrences = Annotated[tuple[Positive, ...], BeforeValidator(_list)]
Probability = Annotated[Number, Field(gt=0, le=1)]


class Window(Section):
    """When and how often: keys that faults of frames have in common."""

    after: NotNegativeTime = 0.0
    until: PositiveTime | None = None
    nth: Occurrences = ()
    probability: Probability = 1.0
    at_most: Positive | None = None


class OnFrames(Window):
    """Faults of frames that are named."""

    frame: FrameName
    axis: str | None = None


class Drop(OnFrames):
    """`fault: drop`."""

    fault: Literal["drop"]


class Duplicate(OnFrames):
    """`fault: duplicate`."""

    fault: Literal["duplicate"]
    copies: Annotated[StrictInt, Field(ge=1, le=100)] = 1


class Delay(OnFrames):
    """`fault: delay`."""

    fault: Literal["delay"]
    least: NotNegativeTime = 0.0
    most: PositiveTime


class Reorder(OnFrames):
    """`fault: reorder`."""

    fault: Literal["reorder"]
    hold: PositiveTime = 1e-3


class Resize(OnFrames):
    """`fault: resize`."""

    fault: Literal["resize"]
    length: Annotated[StrictInt, Field(ge=0, le=8)]


class Freeze(OnFrames):
    """`fault: freeze`."""

    fault: Literal["freeze"]


class SyncJitter(Window):
    """`fault: sync_jitter`."""

    fault: Literal["sync_jitter"]
    most: PositiveTime


class SyncMiss(Window):
    """`fault: sync_miss`."""

    fault: Literal["sync_miss"]
    axis: str | None = None


class HeartbeatSilence(Section):
    """`fault: heartbeat_silence`."""

    fault: Literal["heartbeat_silence"]
    of: str
    after: NotNegativeTime
    until: PositiveTime | None = None


class BusOff(Section):
    """`fault: bus_off`."""

    fault: Literal["bus_off"]
    of: str
    at: NotNegativeTime
    duration: PositiveTime


class Reboot(Section):
    """`fault: reboot`."""

    fault: Literal["reboot"]
    axis: str
    at: NotNegativeTime


class SdoAbort(Section):
    """`fault: sdo_abort`."""

    fault: Literal["sdo_abort"]
    axis: str
    nth: Positive = 1
    times: Positive = 1
    code: Annotated[int, _hexadecimal(_CODE, "0x08000000")] = 0x08000000
    object: Annotated[int, _hexadecimal(_OBJECT, "0x6060")] | None = None
    after: NotNegativeTime = 0.0


class DriveFault(Section):
    """`fault: drive`."""

    fault: Literal["drive"]
    axis: str
    error: Literal[
        "over_current", "encoder_loss", "under_voltage", "over_travel", "following_error",
        "over_voltage", "over_temperature", "hardware",
    ]  # fmt: skip
    at: NotNegativeTime | None = None
    position: Length | None = None
    until: NotNegativeTime | None = None


class SafeTorqueOff(Section):
    """`fault: sto`."""

    fault: Literal["sto"]
    axis: str
    at: NotNegativeTime
    until: NotNegativeTime | None = None


FaultSection = Annotated[
    Drop | Duplicate | Delay | Reorder | Resize | Freeze | SyncJitter | SyncMiss
    | HeartbeatSilence | BusOff | Reboot | SdoAbort | DriveFault
    | SafeTorqueOff,
    Field(discriminator="fault"),
]  # fmt: skip


class FaultsFile(Section):
    """A faults file from its top."""

    seed: Annotated[StrictInt, Field(ge=0, lt=2**63)] | None = None
    faults: Annotated[list[FaultSection], Field(min_length=1, max_length=1000)]


def load_faults(path: Path, machine: Machine, seed: int) -> sim.FaultPlan:
    """The faults of a file, for a machine.

    Args:
        path: of the file.
        machine: whose axes it names.
        seed: where the file has none.

    Raises:
        ConfigError: the file cannot be used; one line per problem.
    """
    return _plan(load_document(path), machine, seed)


def parse_faults(text: str, name: str, machine: Machine, seed: int) -> sim.FaultPlan:
    """The faults of a text; `name` is what problems call it.

    Raises:
        ConfigError: as `load_faults`.
    """
    return _plan(parse_document(text, name), machine, seed)


def _plan(document: Document, machine: Machine, seed: int) -> sim.FaultPlan:
    from hil_sim import faults as sim

    file = validate(document, FaultsFile)
    mapping = _Mapping(document, machine)
    faults = [mapping.fault(section, index) for index, section in enumerate(file.faults)]
    if mapping.problems:
        raise ConfigError(in_order(mapping.problems))
    made = tuple(fault for fault in faults if fault is not None)
    return sim.FaultPlan(made, seed if file.seed is None else file.seed)


class _Mapping:
    """Sections to the simulator's faults; collects what does not fit the machine."""

    def __init__(self, document: Document, machine: Machine) -> None:
        self.problems: list[str] = []
        self._document = document
        self._nodes = {name: axis.node for name, axis in machine.axes.items()}
        self._index = 0

    def fault(self, section: FaultSection, index: int) -> sim.Fault | None:
        """One fault, or None where there was a problem."""
        from hil_sim import faults as sim

        self._index = index
        before = len(self.problems)
        made: sim.Fault | None = None
        match section:
            case OnFrames():
                made = self._on_frames(section)
            case SyncJitter():
                made = sim.Delay(self._frames(section, "sync", None), 0.0, section.most)
            case SyncMiss():
                made = sim.Drop(self._frames(section, "sync", section.axis))
            case HeartbeatSilence():
                window = self._window(section.after, section.until)
                node = HOST_NODE if section.of == HOST else self._node(section.of, "of")
                made = sim.Drop(sim.Frames(frozenset({0x700 + node}), None, None, *window))
            case BusOff():
                of = None if section.of == HOST else self._node(section.of, "of")
                made = sim.BusOff(of, section.at, section.duration)
            case Reboot():
                made = sim.Reboot(self._node(section.axis), section.at)
            case SdoAbort():
                made = sim.SdoAbort(
                    self._node(section.axis), section.nth, section.times, section.code,
                    section.object, section.after,
                )  # fmt: skip
            case SafeTorqueOff():
                if section.until is not None and section.until <= section.at:
                    self._refuse("until", "must be later than at")
                else:
                    made = sim.SafeTorqueOff(self._node(section.axis), section.at, section.until)
            case DriveFault():
                made = self._drive(section)
        return made if len(self.problems) == before else None

    def _on_frames(self, section: OnFrames) -> sim.Fault:
        from hil_sim import faults as sim

        frames = self._frames(section, section.frame, section.axis)
        match section:
            case Duplicate():
                return sim.Duplicate(frames, section.copies)
            case Delay():
                if section.least > section.most:
                    self._refuse("least", f"is more than most, {section.most:g} s")
                return sim.Delay(frames, min(section.least, section.most), section.most)
            case Reorder():
                return sim.Reorder(frames, section.hold)
            case Resize():
                return sim.Resize(frames, section.length)
            case Freeze():
                return sim.Freeze(frames)
        return sim.Drop(frames)

    def _drive(self, section: DriveFault) -> sim.Fault | None:
        from hil_sim import faults as sim

        if (section.at is None) == (section.position is None):
            self._refuse("at", "needs either at or position")
            return None
        if section.until is not None and section.until <= (section.at or 0.0):
            self._refuse("until", "must be later than at")
            return None
        code = sim.DRIVE_FAULTS[section.error]
        return sim.DriveFault(
            self._node(section.axis), code, section.at, section.position, section.until
        )

    def _frames(self, section: Window, frame: str, axis: str | None) -> sim.Frames:
        from hil_sim import faults as sim

        nodes = list(self._nodes.values()) if axis is None else [self._node(axis)]
        node = None if axis is None else nodes[0]
        ids: frozenset[int] | None = None
        sender: sim.Sender | None = "drives" if frame in ("from_drives", *_OF_NODE) else "host"
        if frame in _OF_HOST:
            ids = frozenset({_OF_HOST[frame]})
        elif frame in _TO_NODE or frame in _OF_NODE:
            base = _TO_NODE.get(frame) or _OF_NODE[frame]
            ids, node = frozenset(base + n for n in nodes), None
        elif frame not in _ANY:
            ids, sender = frozenset({int(frame, 16)}), None
        elif frame == "any":
            sender = None
        if sender is None and node is not None:
            self._refuse("axis", "needs a frame that says who sends it")
            node = None
        window = self._window(section.after, section.until)
        return sim.Frames(
            ids, sender, node, *window, frozenset(section.nth), section.probability,
            section.at_most,
        )  # fmt: skip

    def _window(self, after: float, until: float | None) -> tuple[float, float]:
        if until is None:
            return after, math.inf
        if until <= after:
            self._refuse("until", f"must be later than after, {after:g} s")
            return after, math.inf
        return after, until

    def _node(self, axis: str, key: str = "axis") -> int:
        if axis in self._nodes:
            return self._nodes[axis]
        known = [*self._nodes, *([HOST] if key == "of" else [])]
        self._refuse(key, f"no such axis in the machine{suggestion(axis, known)}")
        return next(iter(self._nodes.values()))

    def _refuse(self, key: str, reason: str) -> None:
        self.problems.append(self._document.problem(("faults", self._index, key), reason))
