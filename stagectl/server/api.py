"""The sockets of a server: requests in, answers out, and what is published. In one thread.

Who connects is checked by the system: the sockets lie in a folder of their user's, and 0MQ asks the
kernel for the peer's user and group (ZAP, RFC 27), which must be this user, root or the group that
was let in. A slow reader loses messages at its high-water mark; nobody waits for it.
"""

from __future__ import annotations

import fcntl
import grp
import os
import pwd
import time
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import msgpack
import zmq

from stagectl.errors import StagectlError, UnusableInput
from stagectl.protocol import wire
from stagectl.protocol.endpoint import Endpoint, make_folder
from stagectl.protocol.message import VERSION, Message
from stagectl.protocol.state import Answer, Notice, Refusal
from stagectl.rates import Rates
from stagectl.server.handlers import answer
from stagectl.server.handover import Handover
from stagectl.server.keeper import StageKeeper
from stagectl.server.metrics import Metrics
from stagectl.server.service import Service

_TURN = 0.01  # longest wait for a request before looking at what the stage has handed over [s]
_FRAME = 0.04  # between two blocks of samples [s]
_STATE = 0.1  # between two states at most [s]
_QUEUED = 100  # messages that wait for one slow reader
_DOMAIN = b"stagectl"
_RATE, _BURST = 500.0, 500.0
"""Requests per second of one connection, and how many may come at once."""


class Access:
    """Who may connect: this user, root, and the members of a group if one is given."""

    def __init__(self, group: int | None) -> None:
        self._users = {0, os.getuid()}
        self._group = group
        if group is not None:
            for member in grp.getgrgid(group).gr_mem:
                self._users.add(pwd.getpwnam(member).pw_uid)

    def allows(self, address: str) -> bool:
        """Whether a peer may connect, by 0MQ's address of it: `HOST:UID:GID:PID`."""
        parts = address.rsplit(":", 3)
        if len(parts) != 4 or not all(part.isdigit() for part in parts[1:]):
            return False
        return int(parts[1]) in self._users or int(parts[2]) == self._group


class Api:
    """Binds the sockets and serves until `end`.

    Args:
        endpoint: where.
        group: number of the group that is let in, or None.
        metrics: get all that is published, or None.

    Raises:
        StagectlError: another server is there, or the folder cannot be used.
    """

    def __init__(
        self, endpoint: Endpoint, group: int | None = None, metrics: Metrics | None = None
    ) -> None:
        self._metrics = metrics
        make_folder(endpoint.folder, group)
        self._endpoint = endpoint
        self._lock = _locked(endpoint)
        self._access = Access(group)
        self._context = zmq.Context()
        self._zap = self._context.socket(zmq.REP)
        self._zap.bind("inproc://zeromq.zap.01")
        self._commands = self._bound(zmq.ROUTER, endpoint.commands, group)
        self._events = self._bound(zmq.PUB, endpoint.events, group)
        self._rates = Rates(_RATE, _BURST)
        self._late_answers: SimpleQueue[tuple[bytes, bytes]] = SimpleQueue()
        self._ending = False

    def _bound(self, kind: int, path: Path, group: int | None) -> zmq.Socket[bytes]:
        socket = self._context.socket(kind)
        socket.linger = 0
        socket.zap_domain = _DOMAIN
        socket.sndhwm = _QUEUED
        socket.maxmsgsize = wire.MOST
        path.unlink(missing_ok=True)
        before = os.umask(0o077 if group is None else 0o007)
        try:
            socket.bind(Endpoint.url(path))
        except zmq.ZMQError as why:
            raise StagectlError(f"{path}: {why.strerror}") from why
        finally:
            os.umask(before)
        if group is not None:
            os.chown(path, -1, group)
        return socket

    @property
    def name(self) -> str:
        """The server's name."""
        return self._endpoint.name

    def publish(self, notice: Notice) -> None:
        """Publish a notice; from the serving thread."""
        self._events.send_multipart([wire.NOTICE, wire.encode(notice)])
        if self._metrics is not None:
            self._metrics.take(notice)

    def end(self) -> None:
        """Stop serving; may be called by a signal handler."""
        self._ending = True

    def serve(self, service: Service, keeper: StageKeeper, handover: Handover) -> None:
        """Serve until `end`, or until the stage is gone."""
        poller = zmq.Poller()
        poller.register(self._commands, zmq.POLLIN)
        poller.register(self._zap, zmq.POLLIN)
        frame_due = state_due = 0.0
        while not self._ending and keeper.is_alive():
            ready = dict(poller.poll(round(_TURN * 1e3)))
            if self._zap in ready:
                self._admit()
            if self._commands in ready:
                self._receive(service)
            changed = service.turn()
            if handover.frames:
                self._publish_frames(handover)
            self._send_late_answers()
            now = time.monotonic()
            if now >= frame_due:
                frame_due = now + _FRAME
                self._publish_samples(service, keeper, handover)
            if changed or now >= state_due:
                state_due = now + _STATE
                state = service.state()
                self._events.send_multipart([wire.STATE, wire.encode(state)])
                if self._metrics is not None:
                    self._metrics.look(state)

    def close(self) -> None:
        """Close the sockets and remove them."""
        self._context.destroy(linger=0)
        for path in (self._endpoint.commands, self._endpoint.events, self._endpoint.lock):
            path.unlink(missing_ok=True)
        os.close(self._lock)

    def _admit(self) -> None:
        """Answer 0MQ's question whether a peer may connect."""
        version, number, _, address, *_ = self._zap.recv_multipart()
        allowed = self._access.allows(address.decode(errors="replace"))
        status = (b"200", b"OK") if allowed else (b"400", b"another user's server")
        self._zap.send_multipart([version, number, *status, b"", b""])

    def _receive(self, service: Service) -> None:
        """Take the requests that have come, a few at a time."""
        for _ in range(50):
            try:
                peer, *frames = self._commands.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            self._take(service, peer, frames)

    def _take(self, service: Service, peer: bytes, frames: list[bytes]) -> None:
        number = 0
        try:
            if not self._rates.allows(peer):
                raise UnusableInput(f"more than {_RATE:g} requests per second")
            if len(frames) != 1:
                raise UnusableInput("a request is one frame")
            number = _number_in(frames[0])
            request = wire.decode_request(frames[0])
        except UnusableInput as why:
            self._answer(peer, number, Refusal(kind="invalid", text=str(why)))
            return
        main = True

        def reply(result: Any) -> None:
            if main:
                self._answer(peer, request.id, result)
            else:
                self._late_answers.put((peer, _encoded(request.id, result)))

        answer(service, request, reply)
        main = False

    def _answer(self, peer: bytes, number: int, result: Any) -> None:
        self._commands.send_multipart([peer, _encoded(number, result)])

    def _send_late_answers(self) -> None:
        while True:
            try:
                peer, data = self._late_answers.get_nowait()
            except Empty:
                return
            self._commands.send_multipart([peer, data])

    def _publish_frames(self, handover: Handover) -> None:
        waiting = handover.frames
        frames = [waiting.popleft() for _ in range(len(waiting))]
        self._events.send_multipart([wire.FRAMES, msgpack.packb(frames)])

    def _publish_samples(self, service: Service, keeper: StageKeeper, handover: Handover) -> None:
        waiting, stage = handover.samples, keeper.stage
        samples = [waiting.popleft() for _ in range(len(waiting))]
        if samples and stage is not None:
            block = service.sampling.block(stage, samples)
            self._events.send_multipart([wire.SAMPLES, block.encode()])


def _encoded(number: int, result: Any) -> bytes:
    if isinstance(result, Refusal):
        return wire.encode(Answer(version=VERSION, id=number, refusal=result))
    return wire.encode(Answer(version=VERSION, id=number, result=_plain(result)))


def _plain(result: Any) -> Any:
    """A result as plain values for msgpack."""
    if isinstance(result, Message):
        return result.model_dump(mode="python")
    return [_plain(each) for each in result] if isinstance(result, list) else result


def _number_in(data: bytes) -> int:
    """The number of a request that may be invalid otherwise; 0 where it has none."""
    number = wire.unpack(data)
    found = number.get("id") if isinstance(number, dict) else None
    return found if isinstance(found, int) and 0 <= found < 2**31 else 0


def _locked(endpoint: Endpoint) -> int:
    """The lock file, held until the end.

    Raises:
        StagectlError: another server holds it.
    """
    file = os.open(endpoint.lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        raise StagectlError(f"a stage server {endpoint.name!r} runs already") from None
    return file
