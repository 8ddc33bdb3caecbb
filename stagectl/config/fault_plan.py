"""From a faults file to the simulator's `FaultPlan` for a machine.

Axis and frame names become node ids and CAN-IDs of the predefined connection set of CiA 301, which
both the driver and the virtual drives use.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.settings import HOST_NODE
from stagectl.config.faults import (
    ANY,
    HOST,
    OF_HOST,
    OF_NODE,
    TO_NODE,
    BusOff,
    Delay,
    DriveFault,
    Duplicate,
    FaultSection,
    FaultsFile,
    Freeze,
    HeartbeatSilence,
    OnFrames,
    Reboot,
    Reorder,
    Resize,
    SafeTorqueOff,
    SdoAbort,
    SyncJitter,
    SyncMiss,
    Window,
)
from stagectl.config.machine import Machine
from stagectl.config.parsing.validation import sort_problems, suggest, validate
from stagectl.config.parsing.yaml_nodes import Document, load_document, parse_document
from stagectl.errors import ConfigError

if TYPE_CHECKING:
    from hil_sim.bus import faults as sim


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
    from hil_sim.bus import faults as sim

    file = validate(document, FaultsFile)
    mapping = _Mapping(document, machine)
    faults = [mapping.fault(section, index) for index, section in enumerate(file.faults)]
    if mapping.problems:
        raise ConfigError(sort_problems(mapping.problems))
    made = tuple(fault for fault in faults if fault is not None)
    return sim.FaultPlan(made, seed if file.seed is None else file.seed)


class _Mapping:
    """Turns sections into the simulator's faults; collects what does not fit the machine."""

    def __init__(self, document: Document, machine: Machine) -> None:
        self.problems: list[str] = []
        self._document = document
        self._nodes = {name: axis.node for name, axis in machine.axes.items()}
        self._index = 0

    def fault(self, section: FaultSection, index: int) -> sim.Fault | None:
        """One fault, or None if there was a problem."""
        from hil_sim.bus import faults as sim

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
        from hil_sim.bus import faults as sim

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
        from hil_sim.bus import faults as sim

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
        from hil_sim.bus import faults as sim

        nodes = list(self._nodes.values()) if axis is None else [self._node(axis)]
        node = None if axis is None else nodes[0]
        ids: frozenset[int] | None = None
        sender: sim.Sender | None = "drives" if frame in ("from_drives", *OF_NODE) else "host"
        if frame in OF_HOST:
            ids = frozenset({OF_HOST[frame]})
        elif frame in TO_NODE or frame in OF_NODE:
            base = TO_NODE.get(frame) or OF_NODE[frame]
            ids, node = frozenset(base + n for n in nodes), None
        elif frame not in ANY:
            ids, sender = frozenset({int(frame, 16)}), None
        elif frame == "any":
            sender = None
        if sender is None and node is not None:
            self._refuse("axis", "needs a frame with a known sender")
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
        self._refuse(key, f"no such axis in the machine{suggest(axis, known)}")
        return next(iter(self._nodes.values()))

    def _refuse(self, key: str, reason: str) -> None:
        self.problems.append(self._document.problem(("faults", self._index, key), reason))
