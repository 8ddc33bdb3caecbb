"""The drives' connection to a python-can bus that may fail and return.

Like drives in a rack, it outlives the bus: an interface that is down, removed or bus-off is waited
for without limit. Frames sent meanwhile are lost; the axes stop because they miss the host's
heartbeat.

SocketCAN reports an interface that goes down only once, and a socket whose interface was removed
does not find its successor. So the bus is reopened until it can be read. After bus-off that is not
needed: kernel or operator restart the controller, and the socket reports it (linux/can/error.h).
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from contextlib import suppress

import can

RETRY_NS = 500_000_000
"""Time between attempts to reopen the bus [ns]."""
_BUS_OFF, _RESTARTED = 0x040, 0x100  # error classes, in the id of an error frame
_AWAY = (errno.ENETDOWN, errno.ENETUNREACH, errno.ENODEV, errno.ENXIO)
_FAILURES = (can.CanError, OSError, ValueError)  # ValueError: select on a closed socket


def _system_error(failure: BaseException) -> OSError | None:
    """The error of the operating system behind a failure, if there is one."""
    for error in (failure, failure.__cause__):
        if isinstance(error, OSError) and error.errno is not None:
            return error
    return None


class Connection:
    """Sends and receives while the bus is available.

    Args:
        bus: open.
        reopen: opens the bus again, or returns None while it cannot be opened. Without `reopen` a
            failure of the bus is an error; with it, the bus is closed here.
        notify: called with a line when the bus fails and when it is back.
        clock: monotonic time [ns].
    """

    def __init__(
        self,
        bus: can.BusABC,
        reopen: Callable[[], can.BusABC | None] | None = None,
        notify: Callable[[str], object] = lambda _: None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._bus: can.BusABC | None = bus
        self._reopen = reopen
        self._notify = notify
        self._clock = clock
        self._away = False
        self._reopened = False
        self._retry_ns: int | None = None
        self._failures = 0  # in a row

    def send(self, message: can.Message) -> bool:
        """Send a frame; return whether the bus accepted it."""
        if self._bus is None:
            return False
        try:
            self._bus.send(message)
        except _FAILURES as failure:
            error = _system_error(failure)
            if error is not None and error.errno in _AWAY:
                self._report_loss(os.strerror(error.errno))
            return False
        return True

    def recv(self, timeout: float) -> can.Message | None:
        """Return the next frame; None after `timeout` [s], or if the bus is not available.

        Raises:
            can.CanError, OSError, ValueError: the bus has failed, and there is no `reopen`.
        """
        if self._retry_ns is not None and self._clock() >= self._retry_ns:
            self._try_reopen()
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
                self._report_loss("bus-off", reopen=False)
            elif message.arbitration_id & _RESTARTED:
                self._report_return()
        elif self._away and (message is not None or self._reopened):
            self._report_return()
        return message

    def close(self) -> None:
        """Close the bus, if it was to be reopened here."""
        if self._reopen is not None and self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def _on_failure(self, failure: BaseException) -> None:
        self._failures += 1
        error = _system_error(failure)
        if error is not None and error.errno is not None:
            self._report_loss(os.strerror(error.errno))
        elif self._failures > 1:  # a single one may be a datagram that is no CAN frame
            self._report_loss(" ".join(str(failure).split()) or type(failure).__name__)

    def _report_loss(self, reason: str, reopen: bool = True) -> None:
        if not self._away:
            self._away = True
            self._notify(f"{reason}; the drives wait for it")
        self._reopened = False
        if reopen and self._reopen is not None and self._retry_ns is None:
            self._retry_ns = self._clock() + RETRY_NS

    def _report_return(self) -> None:
        if self._away:
            self._notify("is back")
        self._away = self._reopened = False
        self._retry_ns = None

    def _try_reopen(self) -> None:
        if self._bus is not None:
            with suppress(*_FAILURES):
                self._bus.shutdown()  # some interfaces can be opened only once
        self._bus = None if self._reopen is None else self._reopen()
        self._reopened = self._bus is not None
        self._retry_ns = None if self._reopened else self._clock() + RETRY_NS
