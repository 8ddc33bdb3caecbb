"""Detects another host on the bus: frames with the host's CAN-IDs that this host did not send.

CiA 301 gives each of these CAN-IDs one sender. Two hosts that command the same drives undo each
other's work without either having a fault.

Some buses return a host's own frames (udp_multicast always, SocketCAN on request) without marking
them. There a frame is ours if it is one sent and not yet returned, or a copy of one just sent
(networks duplicate frames now and then). A second SYNC cannot be distinguished from ours there; but
a host that sends SYNC also sends setpoints. Beside the kernel's SYNC one is found by its times.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import can

from drivers.canopen.clock import Clock
from drivers.canopen.nmt import NMT_COMMANDS
from drivers.objects import SYNC_ID
from drivers.settings import HOST_NODE

NMT_ID, HEARTBEAT_ID = 0x000, 0x700 + HOST_NODE
LISTENING = 0.12
"""An active host sends SYNC or a heartbeat in this time [s]."""

_COPY_NS = 20_000_000
"""Copies of a frame arrive within this time."""
_LOST_NS = 2_000_000_000
"""A frame that has not been returned after this time never will be."""


class OtherHost:
    """Distinguishes the host's own frames from those of another host.

    Args:
        echoes: whether the bus may return the host's own frames.

    Attributes:
        found: the frame that revealed another host, one clause; None: there is none.
        on_found: called once when another host is found.
        ids: CAN-IDs that only a host sends.
        sent_elsewhere: those of them sent on our behalf (SYNC by the kernel).
        echoes: as above.
    """

    def __init__(self, echoes: bool) -> None:
        self.echoes = echoes
        self.found: str | None = None
        self.on_found: Callable[[], object] | None = None
        self.ids = {NMT_ID, SYNC_ID, HEARTBEAT_ID}
        self.sent_elsewhere: set[int] = set()
        self._unreturned: dict[int, deque[tuple[bytes, int]]] = {}
        self._last: dict[int, tuple[bytes, int]] = {}

    def note_sent(self, can_id: int, data: bytes, now: int) -> None:
        """Notes a frame that this host sends at `now` [ns]; needed only where the bus echoes."""
        if can_id in self.ids:
            self._unreturned.setdefault(can_id, deque(maxlen=64)).append((data, now))
            self._last[can_id] = data, now

    def has_sent(self, message: can.Message, now: int) -> bool:
        """Whether a frame with one of `ids`, received at `now` [ns], is another host's."""
        can_id, data = message.arbitration_id, bytes(message.data)
        if can_id in self.sent_elsewhere:
            return False
        if self._is_ours(can_id, data, now) if self.echoes else not message.is_rx:
            return False
        self.reveal(_describe(can_id, data))
        return True

    def reveal(self, frame: str) -> None:
        """Notes the frame, one clause, that reveals another host."""
        if self.found is None:
            self.found = frame
            if self.on_found is not None:
                self.on_found()

    def _is_ours(self, can_id: int, data: bytes, now: int) -> bool:
        unreturned = self._unreturned.get(can_id, ())
        for place, (payload, at) in enumerate(unreturned):
            if payload == data and now - at < _LOST_NS:
                for _ in range(place + 1):  # frames keep their order: earlier ones are lost
                    self._unreturned[can_id].popleft()
                return True
        payload, at = self._last.get(can_id, (b"", -_LOST_NS))
        return payload == data and now - at < _COPY_NS


def may_echo(bus: object) -> bool:
    """Whether a python-can bus may return its user's own frames unmarked."""
    return not (
        ".virtual" in type(bus).__module__ or isinstance(getattr(bus, "clock", None), Clock)
    )


def _describe(can_id: int, data: bytes) -> str:
    if can_id == NMT_ID:
        if len(data) != 2:
            return "an NMT command (0x000)"
        command = NMT_COMMANDS.get(data[0], f"0x{data[0]:02X}")
        whom = f"node {data[1]}" if data[1] else "all nodes"
        return f"the NMT command '{command}' (0x000) for {whom}"
    if can_id == SYNC_ID:
        return "a SYNC (0x080)"
    if can_id == HEARTBEAT_ID:
        return f"a heartbeat of node {HOST_NODE} (0x{can_id:03X})"
    return f"setpoints for node {can_id & 0x7F} (0x{can_id:03X})"
