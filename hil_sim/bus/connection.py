"""The drives' connection to a python-can bus that may go away and come back.

Drives in a rack outlive their bus: an interface that is taken down, removed or bus-off is waited
for, for as long as it takes. What that means for the axes is the drives' own business: they miss
the host's heartbeat. A frame sent meanwhile is lost.

SocketCAN tells a socket once that its interface is down, and one whose interface was removed never
hears of the next of that name. So the bus is opened again and again until one can be read. After
bus-off that isn't needed: the controller is restarted by the kernel or by the operator, and the
socket is told (linux/can/error.h).
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from contextlib import suppress

import can

RETRY_NS = 500_000_000
"""How long after a failure the bus is opened again."""
_BUS_OFF, _RESTARTED = 0x040, 0x100  # classes of error frames
_AWAY = (errno.ENETDOWN, errno.ENETUNREACH, errno.ENODEV, errno.ENXIO)
_FAILURES = (can.CanError, OSError, ValueError)  # ValueError: select on a closed socket


def _system_error(failure: BaseException) -> OSError | None:
    """What the operating system said, where it was that which failed."""
    for why in (failure, failure.__cause__):
        if isinstance(why, OSError) and why.errno is not None:
            return why
    return None


class Connection:
    """Sends and receives on a bus for as long as there is one.

    Args:
        bus: opened already.
        reopen: opens it again, None where that can't be done yet; without `reopen` a bus that
            fails is an error, else it is closed here.
        told: called with a line when the bus goes, and when it is back.
        clock: monotonic time [ns].
    """

    def __init__(
        self,
        bus: can.BusABC,
        reopen: Callable[[], can.BusABC | None] | None = None,
        told: Callable[[str], object] = lambda _: None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._bus: can.BusABC | None = bus
        self._reopen = reopen
        self._told = told
        self._clock = clock
        self._away = False
        self._reopened = False
        self._retry_ns: int | None = None
        self._failures = 0  # in a row

    def send(self, message: can.Message) -> bool:
        """Sends a frame; whether the bus took it."""
        if self._bus is None:
            return False
        try:
            self._bus.send(message)
        except _FAILURES as failure:
            why = _system_error(failure)
            if why is not None and why.errno in _AWAY:
                self._lose(os.strerror(why.errno))
            return False
        return True

    def recv(self, timeout: float) -> can.Message | None:
        """The next frame; None after `timeout` [s], and while there is no bus.

        Raises:
            can.CanError, OSError, ValueError: the bus failed, and there is no `reopen`.
        """
        if self._retry_ns is not None and self._clock() >= self._retry_ns:
            self._open_again()
        if self._bus is None:
            time.sleep(timeout)
            return None
        try:
            message = self._bus.recv(timeout)
        except _FAILURES as failure:
            if self._reopen is None:
                raise
            self._on_failure(failure)
            time.sleep(timeout)
            return None
        self._failures = 0
        if message is not None and message.is_error_frame:
            if message.arbitration_id & _BUS_OFF:
                self._lose("bus-off", reopen=False)
            elif message.arbitration_id & _RESTARTED:
                self._find()
        elif self._away and (message is not None or self._reopened):
            self._find()
        return message

    def close(self) -> None:
        """Closes the bus, where opening it is up to us."""
        if self._reopen is not None and self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def _on_failure(self, failure: BaseException) -> None:
        self._failures += 1
        why = _system_error(failure)
        if why is not None and why.errno is not None:
            self._lose(os.strerror(why.errno))
        elif self._failures > 1:  # else it may have been one datagram that is no CAN frame
            self._lose(" ".join(str(failure).split()) or type(failure).__name__)

    def _lose(self, reason: str, reopen: bool = True) -> None:
        if not self._away:
            self._away = True
            self._told(f"{reason}; the drives wait for it")
        self._reopened = False
        if reopen and self._reopen is not None and self._retry_ns is None:
            self._retry_ns = self._clock() + RETRY_NS

    def _find(self) -> None:
        if self._away:
            self._told("is back")
        self._away = self._reopened = False
        self._retry_ns = None

    def _open_again(self) -> None:
        if self._bus is not None:
            with suppress(*_FAILURES):
                self._bus.shutdown()  # some interfaces can be opened only once
        self._bus = None if self._reopen is None else self._reopen()
        self._reopened = self._bus is not None
        self._retry_ns = None if self._reopened else self._clock() + RETRY_NS
