"""SYNC sent by the kernel: SocketCAN's broadcast manager, on a timer of its own.

The host follows the kernel's phase: it receives its own frames as they were on the bus, and the
first SYNC after its setpoints is theirs. When the host dies, its sockets close and SYNC ends.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import Any

import can

from drivers.objects import SYNC_ID

_SOL_CAN_RAW, _RECV_OWN_MSGS = 101, 4
_RECEIVE_BUFFER = 1 << 22
"""Requested, for the SYNCs that arrive while the host computes [bytes]."""


def receive_own_frames(bus: Any) -> None:
    """Has a SocketCAN bus receive its own frames, with the time they were on the wire."""
    if KernelSync.fits(bus):
        bus.socket.setsockopt(_SOL_CAN_RAW, _RECV_OWN_MSGS, 1)


class KernelSync:
    """Cyclic SYNC of one SocketCAN bus.

    Args:
        bus: a python-can bus; from `start` on it also receives its own frames.
        period_us: Ts [us].
        overflow: of the SYNC counter (0x1019); 0: no counter.
    """

    def __init__(self, bus: can.BusABC, period_us: int, overflow: int) -> None:
        self._bus: Any = bus
        counts = [bytes((n,)) for n in range(1, overflow + 1)] or [b""]
        self._messages = [
            can.Message(arbitration_id=SYNC_ID, is_extended_id=False, data=data) for data in counts
        ]
        # python-can truncates to whole microseconds: a rounding error would cost one
        self._period = (period_us + 0.5) * 1e-6
        self._task: Any = None

    @staticmethod
    def fits(bus: object) -> bool:
        """Whether the kernel can send cyclic frames on this bus."""
        return ".socketcan" in type(bus).__module__ and isinstance(
            getattr(bus, "socket", None), socket.socket
        )

    def start(self) -> None:
        """Starts one SYNC per period.

        Raises:
            can.CanError, OSError: the kernel has no broadcast manager, or refuses.
        """
        if self._task is None:
            own: socket.socket = self._bus.socket
            receive_own_frames(self._bus)
            own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            self._task = self._bus.send_periodic(self._messages, self._period, store_task=False)

    def stop(self) -> None:
        """Stops SYNC; never raises."""
        task, self._task = self._task, None
        if task is not None:
            with suppress(can.CanError, OSError):
                task.stop()
