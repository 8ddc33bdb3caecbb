"""The host's end of the bus, without a receiving thread: whoever waits receives.

`Network` is canopen's network without its Notifier. It reads the bus, feeds the services (SDO,
heartbeat, EMCY) through `notify`, sends the host's heartbeat when due, and shows every frame to the
`tap`. The cyclic path (`drivers.cyclic.reception`) reads the same bus in a loop of its own and
passes on what is not process data. One thread at a time: the one that receives holds `lock`.
"""

from __future__ import annotations

import errno
import logging
import os
import socket
import struct
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import can
import canopen

from drivers.canopen.clock import Clock, clock_of
from drivers.canopen.other_host import HEARTBEAT_ID, OtherHost, may_echo
from drivers.errors import BusError, BusOpenError
from drivers.settings import BusSettings

Tap = Callable[[int, int, bytes], object]
"""Called with every frame sent or received: (time [ns], CAN-ID, data). The CAN-ID `BUS_FAILED`
marks a failure of the bus."""
BUS_FAILED = 0x2000_0000
"""SocketCAN's flag of an error frame."""

_IP_MULTICAST_ALL, _IPV6_MULTICAST_ALL = 49, 29
"""From linux/in.h and linux/in6.h; Python's socket module lacks them."""
HEARTBEAT_NS = 100_000_000
SERVICE_NS = 25_000_000
_JUST_OPENED_NS = 1_000_000_000
_HOST_OPERATIONAL = b"\x05"

# They log what is raised as an exception anyway; without a handler Python prints it to stderr.
for _library in ("can", "canopen"):
    logging.getLogger(_library).addHandler(logging.NullHandler())


_new = object.__new__


class OwnFrame(can.Message):
    """A data frame sent by the host, with a fast copy for python-can's `virtual` bus."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, Any] | None) -> can.Message:
        copied: can.Message = _new(can.Message)  # the constructor takes twice as long
        copied.timestamp, copied.channel, copied.is_rx = self.timestamp, None, True
        copied.arbitration_id, copied.dlc, copied.data = self.arbitration_id, self.dlc, self.data[:]
        copied.is_extended_id = copied.is_remote_frame = copied.is_error_frame = False
        copied.is_fd = copied.bitrate_switch = copied.error_state_indicator = False
        return copied


def open_bus(settings: BusSettings) -> can.BusABC:
    """Opens the python-can bus of the settings.

    Raises:
        BusOpenError: unknown interface, missing driver, no such channel.
    """
    try:
        if settings.interface == "socketcan" and settings.channel:
            _require_interface(settings.channel)
        bus = can.Bus(
            interface=settings.interface, channel=settings.channel, bitrate=settings.bitrate
        )
    except (can.CanError, OSError, ValueError, ImportError, NotImplementedError, TypeError) as why:
        raise BusOpenError(f"bus {settings}: cannot open: {_line(why)}") from why
    if ".udp_multicast" in type(bus).__module__ and sys.platform == "linux":
        _hear_own_group_only(bus)
    return bus


def _require_interface(name: str) -> None:
    """Checks that a network interface exists: where none does, python-can leaves a socket open.

    Raises:
        OSError: as python-can's.
    """
    try:
        socket.if_nametoindex(name)
    except OSError:
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV)) from None


def _hear_own_group_only(bus: can.BusABC) -> None:
    """Ignores multicast groups joined by other programs on this computer, such as other stages."""
    with socket.socket(fileno=os.dup(bus.fileno())) as shared, suppress(OSError):
        if shared.family == socket.AF_INET6:
            shared.setsockopt(socket.IPPROTO_IPV6, _IPV6_MULTICAST_ALL, 0)
        else:
            shared.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)


def _line(problem: BaseException) -> str:
    """An exception's text on one line, or its class where it has no text."""
    return " ".join(str(problem).split()) or type(problem).__name__


class Network(canopen.Network):
    """A canopen network whose owner calls for reception.

    Attributes:
        clock: of the bus.
        tap: called with every frame, or None.
        beats: whether the host's heartbeat is sent. Not by an observer: drives would keep
            running when their real host is lost.
        own_ids: CAN-IDs that the host sends. Received, they are its own echo (udp_multicast loops
            frames back), since a CAN-ID has one sender.
        other_host: detects frames that only another host can have sent.
        watchers: called about every 25 ms with the time [ns], for deadlines.
        service_due: when `service` has to be called next [ns].
        lock: held by the thread that sends and receives.
        owner: the thread (`threading.get_ident`) that alone sends and receives, or None.
        dispatching: the thread (`threading.get_ident`) that is running a received frame's
            callbacks, which must not wait for another frame; or None.
    """

    def __init__(
        self, bus: can.BusABC, label: str, tap: Tap | None = None, beats: bool = True
    ) -> None:
        super().__init__(bus)
        self.label = label
        self.beats = beats
        self.clock: Clock = clock_of(bus)
        self.tap = tap
        self.own_ids: set[int] = set()
        self.other_host = OtherHost(may_echo(bus))
        self.watchers: list[Callable[[int], None]] = []
        self.lock = threading.RLock()
        self.owner: int | None = None
        self.dispatching: int | None = None
        self._beat_due = self.service_due = self._opened = self.clock.now_ns()

    def connect(self, *args: Any, **kwargs: Any) -> Network:
        """Does nothing: the bus is open, and there is no Notifier."""
        return self

    def disconnect(self) -> None:
        """Uses the bus no longer; it is closed by its opener."""
        self.bus = None

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Sends one frame.

        Raises:
            BusError: the bus refuses it.
        """
        payload = bytes(data)
        self.own_ids.add(can_id)
        message = (can.Message if remote else OwnFrame)(
            arbitration_id=can_id, is_extended_id=False, is_remote_frame=remote, data=payload
        )
        try:
            self.put(message, payload, self.clock.now_ns())
        except (can.CanError, OSError, ValueError) as why:
            raise self.failure(f"cannot send frame 0x{can_id:03X}", why) from why

    def put(self, message: can.Message, data: bytes, now: int) -> None:
        """Sends a frame with this data at `now` [ns]; errors of the bus are python-can's own.

        Raises:
            BusError: the bus is closed.
        """
        if self.bus is None:
            raise BusError(f"bus {self.label}: is closed")
        if self.tap is not None:
            self.tap(now, message.arbitration_id, data)
        if self.other_host.echoes:
            self.other_host.note_sent(message.arbitration_id, data, now)
        self.bus.send(message)

    def failure(self, what: str, why: BaseException) -> BusError:
        """A `BusError` that names this bus; the tap gets the failure, too."""
        if self.tap is not None:
            self.tap(self.clock.now_ns(), BUS_FAILED, b"")
        return BusError(f"bus {self.label}: {what}: {_line(why)}")

    def received(self, message: can.Message) -> None:
        """Passes a received frame to the tap and to canopen's services."""
        if message.is_error_frame or message.is_remote_frame or message.is_extended_id:
            return
        others = message.arbitration_id in self.other_host.ids and self.other_host.has_sent(
            message, self.clock.now_ns()
        )
        if message.arbitration_id in self.own_ids and not others:
            return
        if self.tap is not None:
            self.tap(self.clock.now_ns(), message.arbitration_id, bytes(message.data))
        self.dispatching = threading.get_ident()
        try:
            self.notify(message.arbitration_id, message.data, message.timestamp)
        except struct.error:
            pass  # an emergency or heartbeat of the wrong length
        finally:
            self.dispatching = None

    def service(self, now: int) -> None:
        """Sends the host's heartbeat when due and calls the watchers."""
        self.service_due = now + SERVICE_NS
        if self.beats and now >= self._beat_due:
            # not just `+= period`: after a long computation one heartbeat, not a burst
            self._beat_due = max(self._beat_due + HEARTBEAT_NS, now + HEARTBEAT_NS // 2)
            self.send_message(HEARTBEAT_ID, _HOST_OPERATIONAL)
        for watcher in self.watchers:
            watcher(now)

    def check_alone(self) -> None:
        """Checks that this is the only host.

        Raises:
            BusError: another host was heard.
        """
        if self.other_host.found is not None:
            raise BusError(
                f"bus {self.label}: another host is on it: {self.other_host.found} that this one "
                "did not send"
            )

    def listen(self, duration: float) -> None:
        """Receives for `duration` [s] without sending anything.

        If the bus has just been opened, the time since then counts: its queue holds all frames.

        Raises:
            BusError: the bus cannot be read, or another host is heard.
        """
        with self.lock:
            begin = self.clock.now_ns()
            if begin - self._opened <= _JUST_OPENED_NS:
                begin = self._opened
            else:
                while (old := self.receive(0.0)) is not None:
                    self.received(old)
                self.other_host.found = None
            deadline = begin + round(duration * 1e9)
            while True:
                left = deadline - self.clock.now_ns()
                message = self.receive(max(0.0, left * 1e-9))
                if message is not None:
                    self.received(message)
                    self.check_alone()
                if left <= 0 and (message is None or left <= -_JUST_OPENED_NS):
                    return  # even if the queue never gets empty

    def pump(self, duration: float) -> None:
        """Receives and dispatches for `duration` [s]; 0: what is in the queue.

        Raises:
            BusError: the bus cannot be read.
        """
        self.pump_until(lambda: False, duration)

    def pump_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Receives and dispatches until `condition` holds.

        Returns:
            Whether it holds; False after `timeout` [s].

        Raises:
            BusError: the bus cannot be read.
        """
        with self.lock:
            deadline = self.clock.now_ns() + round(timeout * 1e9)
            while not condition():
                now = self.clock.now_ns()
                if now >= self.service_due:
                    # first the queue: a heartbeat that waits there is not lost
                    while (waiting := self.receive(0.0)) is not None:
                        self.received(waiting)
                        if condition():
                            return True
                    self.service(now)
                wait = max(0, min(deadline, self.service_due) - now) if now < deadline else 0
                message = self.receive(wait * 1e-9)
                if message is not None:
                    self.received(message)
                elif now >= deadline:
                    return condition()
            return True

    def receive(self, timeout: float) -> can.Message | None:
        """The next frame of the bus as it is, not passed on; None after `timeout` [s].

        Raises:
            BusError: the bus cannot be read.
        """
        if self.bus is None:
            raise BusError(f"bus {self.label}: is closed")
        try:
            return self.bus.recv(timeout)
        except (can.CanError, OSError, ValueError) as why:
            raise self.failure("cannot receive", why) from why
