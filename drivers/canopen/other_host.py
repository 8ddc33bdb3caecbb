"""Another host on the same bus: frames with the host's own CAN-IDs that this host did not send.

CiA 301 gives each of these ids to one sender. Two hosts that command the same drives undo each
other's work without a fault of either, so one has to be told of the other.

Some buses give a host its own frames back (udp_multicast always, SocketCAN when asked to), and
don't say whose they are. There, a frame is ours when it is one that has not come back yet, or a
copy of one just sent (networks double frames now and then). A second SYNC beside our own cannot be
told there, and need not be: who sends SYNC sends set-points, too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import can

from drivers.canopen.clock import Clock
from drivers.objects import SYNC_ID
from drivers.settings import HOST_NODE

NMT_ID, HEARTBEAT_ID = 0x000, 0x700 + HOST_NODE
LISTENING = 0.12
"""A host that runs sends SYNC or a heartbeat in this time [s]."""

_COPY_NS = 20_000_000
"""Copies of a frame come within this time after it."""
_LOST_NS = 2_000_000_000
"""What has not come back after this time never will."""
_NMT_COMMANDS = {
    1: "start", 2: "stop", 128: "enter PRE-OPERATIONAL", 129: "reset node",
    130: "reset communication",
}  # fmt: skip


class OtherHost:
    """Tells the host's own frames from those of another one.

    Args:
        echoes: whether the bus may give the host its own frames back.

    Attributes:
        found: what another host was found by, one clause; None: none was.
        on_found: called once when one is.
        ids: CAN-IDs that only a host sends.
        sent_elsewhere: those of them that are sent for us, not by us (SYNC by the kernel).
        echoes: as above.
    """

    def __init__(self, echoes: bool) -> None:
        self.echoes = echoes
        self.found: str | None = None
        self.on_found: Callable[[], object] | None = None
        self.ids = {NMT_ID, SYNC_ID, HEARTBEAT_ID}
        self.sent_elsewhere: set[int] = set()
        self._owed: dict[int, deque[tuple[bytes, int]]] = {}
        self._last: dict[int, tuple[bytes, int]] = {}

    def note_sent(self, can_id: int, data: bytes, now: int) -> None:
        """This host sends a frame, at `now` [ns]; needed only where the bus echoes."""
        if can_id in self.ids:
            self._owed.setdefault(can_id, deque(maxlen=64)).append((data, now))
            self._last[can_id] = data, now

    def sends(self, message: can.Message, now: int) -> bool:
        """Whether a frame with one of `ids`, received at `now` [ns], is another host's."""
        can_id, data = message.arbitration_id, bytes(message.data)
        if can_id in self.sent_elsewhere:
            return False
        if self._is_ours(can_id, data, now) if self.echoes else not message.is_rx:
            return False
        if self.found is None:
            self.found = _told(can_id, data)
            if self.on_found is not None:
                self.on_found()
        return True

    def forget(self) -> None:
        """What was found is no longer of interest."""
        self.found = None

    def _is_ours(self, can_id: int, data: bytes, now: int) -> bool:
        owed = self._owed.get(can_id, ())
        for place, (payload, at) in enumerate(owed):
            if payload == data and now - at < _LOST_NS:
                for _ in range(place + 1):  # frames keep their order: those before are lost
                    self._owed[can_id].popleft()
                return True
        payload, at = self._last.get(can_id, (b"", -_LOST_NS))
        return payload == data and now - at < _COPY_NS


def may_echo(bus: object) -> bool:
    """Whether a python-can bus may give back its user's own frames without saying so."""
    return not (
        ".virtual" in type(bus).__module__ or isinstance(getattr(bus, "clock", None), Clock)
    )


def _told(can_id: int, data: bytes) -> str:
    if can_id == NMT_ID:
        if len(data) != 2:
            return "an NMT command (0x000)"
        command = _NMT_COMMANDS.get(data[0], f"0x{data[0]:02X}")
        whom = f"node {data[1]}" if data[1] else "all nodes"
        return f"the NMT command '{command}' (0x000) for {whom}"
    if can_id == SYNC_ID:
        return "a SYNC (0x080)"
    if can_id == HEARTBEAT_ID:
        return f"a heartbeat of node {HOST_NODE} (0x{can_id:03X})"
    return f"set-points for node {can_id & 0x7F} (0x{can_id:03X})"
