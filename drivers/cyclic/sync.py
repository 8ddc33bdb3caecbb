"""SYNC sent by the kernel: SocketCAN's broadcast manager, on its own timer.

The host then keeps the kernel's phase: it sees its own frames as they went over the bus, and a SYNC
counts as the one of its setpoints when it came after them. A host that dies takes its broadcast
manager's socket, and so the SYNC, with it.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import Any

import can

from drivers.objects import SYNC_ID

_SOL_CAN_RAW, _RECV_OWN_MSGS = 101, 4
_RECEIVE_BUFFER = 1 << 22
"""SYNC goes on while the host computes; the system may grant less [bytes]."""


def hear_own_frames(bus: Any) -> None:
    """Lets a SocketCAN bus receive what it sends, with the time it was on the wire at."""
    if KernelSync.fits(bus):
        bus.socket.setsockopt(_SOL_CAN_RAW, _RECV_OWN_MSGS, 1)


class KernelSync:
    """Cyclic SYNC of one SocketCAN bus.

    Args:
        bus: python-can's; from `start` on it also receives what it sends.
        period_us: Ts [us].
        overflow: of the counter (0x1019), 0 for none.
    """

    def __init__(self, bus: can.BusABC, period_us: int, overflow: int) -> None:
        self._bus: Any = bus
        counts = [bytes((n,)) for n in range(1, overflow + 1)] or [b""]
        self._messages = [
            can.Message(arbitration_id=SYNC_ID, is_extended_id=False, data=data) for data in counts
        ]
        # python-can cuts to whole microseconds: what is short of one by a rounding error loses it
        self._period = (period_us + 0.5) * 1e-6
        self._task: Any = None

    @staticmethod
    def fits(bus: object) -> bool:
        """Whether this is a bus whose cyclic sending is the kernel's."""
        return ".socketcan" in type(bus).__module__ and isinstance(
            getattr(bus, "socket", None), socket.socket
        )

    def start(self) -> None:
        """From now on one SYNC per period.

        Raises:
            can.CanError, OSError: the kernel has no broadcast manager, or refuses.
        """
        if self._task is None:
            own: socket.socket = self._bus.socket
            hear_own_frames(self._bus)
            own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            self._task = self._bus.send_periodic(self._messages, self._period, store_task=False)

    def stop(self) -> None:
        """No more SYNC; never raises."""
        task, self._task = self._task, None
        if task is not None:
            with suppress(can.CanError, OSError):
                task.stop()
