"""Which frames the faults of a plan strike, and what becomes of them.

A `Line` is one direction of frames with its rules; `fault_world` puts the lines in their places.
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
class Injected:
    """What became of one fault of the plan.

    Attributes:
        fault: it.
        count: how often it struck.
        first_ns, last_ns: when [ns]; -1 before it did.
    """

    fault: f.Fault
    count: int = 0
    first_ns: int = -1
    last_ns: int = -1

    def note(self, now_ns: int) -> None:
        """It struck."""
        self.count += 1
        self.last_ns = now_ns
        if self.first_ns < 0:
            self.first_ns = now_ns


class Line:
    """One direction of frames, with the rules that strike there and the frames held back."""

    def __init__(self, world: World, rules: list[Rule]) -> None:
        self._world = world
        self._rules = rules
        self._of: dict[tuple[int, int | None], tuple[Rule, ...]] = {}
        self._held: list[Callable[[], None]] = []

    def carry(self, can_id: int, data: bytes, node: int | None, send: Send) -> None:
        """Send a frame the way the rules have it."""
        rules = self._of.get((can_id, node))
        if rules is None:
            rules = tuple(r for r in self._rules if r.fits(can_id, node))
            self._of[can_id, node] = rules
        held, self._held = self._held, []
        frames = [(0, data)]
        hold_ns = 0
        for rule in rules:
            if rule.strikes(can_id, data, self._world.now_ns):
                if isinstance(rule.fault, f.Reorder):
                    hold_ns = nanoseconds(rule.fault.hold)
                else:
                    frames = rule.changed(can_id, frames)
        now = self._world.now_ns
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
        else:  # nothing went by that could have overtaken them
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


class Rule:
    """A fault of frames: whether it strikes this one, and what comes of it."""

    def __init__(self, entry: Injected, fault: f.FrameFault, random: np.random.Generator) -> None:
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

    def on_way(self, sender: f.Sender) -> bool:
        """Whether it strikes frames that go this way."""
        return self._frames.sender in (None, sender)

    def fits(self, can_id: int, node: int | None) -> bool:
        """Whether it is about frames with this id, of this node."""
        ids = self._frames.ids
        return (ids is None or can_id in ids) and self.node in (None, node)

    def strikes(self, can_id: int, data: bytes, now_ns: int) -> bool:
        """Whether it strikes this frame; counts it."""
        frames = self._frames
        struck = self._after_ns <= now_ns < self._until_ns
        if struck:
            self._seen += 1
            struck = (
                (not frames.nth or self._seen in frames.nth)
                and (frames.at_most is None or self._entry.count < frames.at_most)
                and (frames.probability >= 1.0 or self._random.random() < frames.probability)
            )
        if struck:
            self._entry.note(now_ns)
        else:
            self._last[can_id] = data
        return struck

    def changed(self, can_id: int, frames: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """What comes of the frames (delay [ns], data)."""
        match self.fault:
            case f.Drop():
                return []
            case f.Duplicate(copies=copies):
                return frames * (1 + copies)
            case f.Delay(least=least, most=most):
                return [
                    # Up to whole microseconds, more than that no bus log shows; and never to 0: a
                    # SYNC at its very instant is one control tick of the drive before all others.
                    (delay + math.ceil(self._random.uniform(least, most) * 1e6) * 1000, data)
                    for delay, data in frames
                ]
            case f.Resize(length=length):
                return [(delay, data[:length].ljust(length, b"\0")) for delay, data in frames]
            case f.Freeze():
                return [(delay, self._last.setdefault(can_id, data)) for delay, data in frames]
        return frames


class SdoAborts:
    """Answers SDO requests in the place of a node."""

    def __init__(self, entry: Injected, fault: f.SdoAbort) -> None:
        self._entry = entry
        self._fault = fault
        self._after_ns = nanoseconds(fault.after)
        self._seen = 0

    def answer(self, can_id: int, data: bytes, now_ns: int) -> tuple[int, bytes] | None:
        """The abort frame, or None where the request may pass."""
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
    """A time of a plan in [ns]."""
    return round(seconds * 1e9)
