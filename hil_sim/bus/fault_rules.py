"""Which frames the faults of a plan act on, and what becomes of them.

A `FaultyLine` carries the frames of one direction; `fault_world` connects the lines.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil_sim.bus import faults as f
from hil_sim.bus.world import World

_ABORT = struct.Struct("<B3sI")

Send = Callable[[bytes], None]


@dataclass(slots=True)
class InjectedFault:
    """A fault of the plan, and when it occurred.

    Attributes:
        fault: as planned.
        count: occurrences.
        first_ns: time of the first one [ns]; -1 before it.
    """

    fault: f.Fault
    count: int = 0
    first_ns: int = -1

    def note(self, now_ns: int) -> None:
        """Count an occurrence."""
        self.count += 1
        if self.first_ns < 0:
            self.first_ns = now_ns


class FaultyLine:
    """Carries frames in one direction, with the rules that act there and the frames held back."""

    def __init__(self, world: World, rules: list[FrameRule]) -> None:
        self._world = world
        self._rules = rules
        self._held: list[Callable[[], None]] = []

    def carry(self, can_id: int, data: bytes, node: int | None, send: Send) -> None:
        """Send a frame as the rules leave it: lost, altered, repeated, late or held back.

        Args:
            can_id: of the frame.
            data: of the frame.
            node: the node that sends or receives it; None: the host, to all nodes.
            send: delivers a payload.
        """
        held, self._held = self._held, []
        frames = [(0, data)]
        hold_ns = 0
        now = self._world.now_ns
        for rule in self._rules:
            if rule.matches(can_id, node) and rule.triggers(can_id, data, now):
                if isinstance(rule.fault, f.Reorder):
                    hold_ns = nanoseconds(rule.fault.hold)
                else:
                    frames = rule.alter(can_id, frames)
        for delay, payload in frames:
            if hold_ns:
                self._hold(now + delay + hold_ns, partial(send, payload))
            elif delay:
                self._world.at(now + delay, partial(send, payload))
            else:
                send(payload)
        if frames:
            for release in held:
                release()
        else:  # lost: frames that are held back wait for the next one
            self._held = held

    def _hold(self, latest_ns: int, send: Callable[[], None]) -> None:
        done = False

        def release() -> None:
            nonlocal done
            if not done:
                done = True
                send()

        self._held.append(release)
        self._world.at(latest_ns, release)


class FrameRule:
    """A fault of frames: whether it acts on a frame, and what it makes of it."""

    def __init__(
        self, entry: InjectedFault, fault: f.FrameFault, random: np.random.Generator
    ) -> None:
        self.fault = fault
        frames = self.fault.frames
        self.node = frames.node
        self._entry = entry
        self._frames = frames
        self._after_ns = nanoseconds(frames.after)
        self._until_ns = nanoseconds(frames.until) if frames.until < 1e9 else 1 << 62
        self._random = random
        self._seen = 0
        self._last: dict[int, bytes] = {}

    def acts_on_frames_of(self, sender: f.Sender) -> bool:
        """Whether it acts on frames of the host, or of the drives."""
        return self._frames.sender in (None, sender)

    def matches(self, can_id: int, node: int | None) -> bool:
        """Whether it is about frames with this id, of this node."""
        ids = self._frames.ids
        return (ids is None or can_id in ids) and self.node in (None, node)

    def triggers(self, can_id: int, data: bytes, now_ns: int) -> bool:
        """Decide whether it acts on this frame, which is counted."""
        frames = self._frames
        acts = self._after_ns <= now_ns < self._until_ns
        if acts:
            self._seen += 1
            acts = (
                (not frames.nth or self._seen in frames.nth)
                and (frames.at_most is None or self._entry.count < frames.at_most)
                and (frames.probability >= 1.0 or self._random.random() < frames.probability)
            )
        if acts:
            self._entry.note(now_ns)
        else:
            self._last[can_id] = data
        return acts

    def alter(self, can_id: int, frames: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """What the fault makes of frames, each (delay [ns], data)."""
        match self.fault:
            case f.Drop():
                return []
            case f.Duplicate(copies=copies):
                return frames * (1 + copies)
            case f.Delay(least=least, most=most):
                return [
                    # Rounded up to the resolution of a bus log, 1 us, and never 0: a SYNC without
                    # any delay would be one control tick of the drive before all others.
                    (delay + math.ceil(self._random.uniform(least, most) * 1e6) * 1000, data)
                    for delay, data in frames
                ]
            case f.Resize(length=length):
                return [(delay, data[:length].ljust(length, b"\0")) for delay, data in frames]
            case f.Freeze():
                return [(delay, self._last.setdefault(can_id, data)) for delay, data in frames]
        return frames


class SdoAbortRule:
    """Answers SDO requests in place of a node."""

    def __init__(self, entry: InjectedFault, fault: f.SdoAbort) -> None:
        self._entry = entry
        self._fault = fault
        self._after_ns = nanoseconds(fault.after)
        self._seen = 0

    def answer(self, can_id: int, data: bytes, now_ns: int) -> tuple[int, bytes] | None:
        """Id and data of the abort, or None if the request may pass."""
        fault = self._fault
        if can_id != 0x600 + fault.node or now_ns < self._after_ns or not _initiates(data):
            return None
        if fault.index is not None and fault.index != int.from_bytes(data[1:3], "little"):
            return None
        self._seen += 1
        if not fault.nth <= self._seen < fault.nth + fault.times:
            return None
        self._entry.note(now_ns)
        return 0x580 + fault.node, _ABORT.pack(0x80, data[1:4], fault.code)


def _initiates(data: bytes) -> bool:
    """Whether an SDO request begins a transfer: download, upload, block upload, block download."""
    if len(data) != 8:
        return False
    command = data[0] >> 5
    return (
        command in (1, 2)
        or (command == 5 and not data[0] & 3)
        or (command == 6 and not data[0] & 1)
    )


def nanoseconds(seconds: float) -> int:
    """Convert a time of a plan to [ns]."""
    return round(seconds * 1e9)
