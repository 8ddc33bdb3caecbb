"""The bus of a stage server, for programs that speak CANopen: reads it, and asks nodes by SDO."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import can
import msgpack
import zmq

from stagectl.client.base import NoServer, Refused
from stagectl.client.synchronous import Client
from stagectl.protocol.requests import Listen, SendFrame
from stagectl.protocol.wire import FRAMES

_RENEWED = 5.0
"""Between two requests to go on publishing frames [s]."""


class ServedBus(can.BusABC):
    """A bus of python-can behind a stage server: all frames in, SDO requests out.

    Args:
        client: of the server; it stays open.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._frames: deque[can.Message] = deque()
        self._socket: zmq.Socket[bytes] = client.subscribe(FRAMES)
        self._renewed = 0.0
        self._renew()
        self.channel_info = f"stage server, {client.info.bus}"
        super().__init__(channel=client.info.bus)

    def _renew(self) -> None:
        now = time.monotonic()
        if now - self._renewed >= _RENEWED:
            self._renewed = now
            self._client.ask(Listen())

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send an SDO request.

        Raises:
            can.CanOperationError: the server refuses it.
        """
        try:
            self._client.ask(SendFrame(can_id=msg.arbitration_id, data=bytes(msg.data)))
        except (Refused, NoServer, ValueError) as why:
            text = "only SDO requests are sent" if isinstance(why, ValueError) else str(why)
            raise can.CanOperationError(f"{self.channel_info}: {text}") from why

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self._renew()
        if not self._frames:
            wait = None if timeout is None else max(0, round(timeout * 1e3))
            if self._socket.poll(wait):
                _, data = self._socket.recv_multipart()
                self._frames.extend(_message(*frame) for frame in msgpack.unpackb(data))
        return (self._frames.popleft() if self._frames else None), False

    def shutdown(self) -> None:
        """Stop reading; the server goes on."""
        self._socket.close()
        super().shutdown()


def _message(time_ns: int, can_id: int, data: bytes, *_: Any) -> can.Message:
    return can.Message(
        timestamp=time_ns * 1e-9, arbitration_id=can_id, is_extended_id=False, data=data
    )
