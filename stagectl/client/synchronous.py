"""A client that waits for its answers."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, Self

import zmq

from stagectl.client.base import ANSWER, JobFailed, NoServer, Published, Talk, read_published
from stagectl.client.finding import locate
from stagectl.protocol import requests
from stagectl.protocol.endpoint import Endpoint
from stagectl.protocol.state import Job, Notice, ServerInfo, State
from stagectl.protocol.wire import NOTICE, SAMPLES, STATE

_SLICE = 10.0
"""Longest single wait for a job [s]."""


class Client:
    """A connection to a stage server; a context manager. Not for several threads.

    Args:
        server: its name, its endpoint, or None for the only one there is.
        name: of this client, as others see it.

    Attributes:
        info: who serves.

    Raises:
        NoServer: none answers, or there are several.
    """

    def __init__(self, server: str | Endpoint | None = None, name: str | None = None) -> None:
        self._talk = Talk(name)
        self._where = locate(server)
        self._context = zmq.Context()
        self._commands = self._context.socket(zmq.DEALER)
        self._commands.linger = 0
        self._commands.connect(Endpoint.url(self._where.commands))
        try:
            self.info = ServerInfo.model_validate(self.ask(requests.Info()))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; what was asked for goes on."""
        self._context.destroy(linger=0)

    def ask(self, command: requests.Command, timeout: float = ANSWER) -> Any:
        """Ask for something, and return its result.

        Args:
            command: of `stagectl.protocol.requests`.
            timeout: longest wait for the answer [s].

        Raises:
            Refused: the server refuses it.
            NoServer: no answer.
        """
        number, data = self._talk.request(command)
        self._commands.send(data)
        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0:
            if self._commands.poll(round(left * 1e3) + 1):
                answered, result = self._talk.answer(self._commands.recv())
                if answered == number:
                    return result
        raise NoServer(f"the stage server {self._where.name} does not answer ({timeout:g} s)")

    def state(self) -> State:
        """The present state of the stage."""
        return State.model_validate(self.ask(requests.GetState()))

    def notices(self, since: int = 0) -> list[Notice]:
        """What has happened since the notice of this number."""
        return [Notice.model_validate(entry) for entry in self.ask(requests.GetEvents(since=since))]

    def take(self, force: bool = False) -> None:
        """Take command, so that other clients only watch, until `release` or the end.

        Raises:
            Refused: another client commands, and `force` is not given.
        """
        self._talk.lease = self.ask(requests.Take(force=force))["lease"]

    def release(self) -> None:
        """Give command back."""
        if self._talk.lease is not None:
            self.ask(requests.Release())
            self._talk.lease = None

    def stop(self, reason: str = "") -> None:
        """Quick-stop all axes and switch their power off."""
        self.ask(requests.Stop(reason=reason))

    def begin(self, command: requests.Command) -> Job:
        """Ask for something that takes time, and return its job at once."""
        return Job.model_validate(self.ask(command))

    def look(self, job: Job, timeout: float) -> Job:
        """A job as it is when it has ended, or after `timeout` [s]."""
        wait = requests.Wait(job=job.id, timeout=timeout)
        return Job.model_validate(self.ask(wait, timeout + ANSWER))

    def wait(self, job: Job | int, timeout: float | None = None) -> Job:
        """Wait until a job has ended.

        Args:
            job: or its id.
            timeout: longest wait [s]; None: no limit.

        Raises:
            JobFailed: it has failed.
            NoServer: the server has ended, or the time is over.
        """
        number = job if isinstance(job, int) else job.id
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            left = _SLICE if end is None else min(_SLICE, end - time.monotonic())
            if left <= 0:
                raise NoServer(f"job {number} has not ended within {timeout:g} s")
            wait = requests.Wait(job=number, timeout=max(left, 1e-3))
            found = Job.model_validate(self.ask(wait, left + ANSWER))
            if found.ended:
                if found.error is not None:
                    raise JobFailed(found)
                return found

    def do(self, command: requests.Command, timeout: float | None = None) -> Job:
        """Ask for something that takes time, and wait until it has ended, at most `timeout` [s].

        Errors as of `wait`.
        """
        return self.wait(self.begin(command), timeout)

    def subscribe(self, *topics: bytes) -> zmq.Socket[bytes]:
        """A SUB socket with these topics, to be closed by the caller."""
        socket = self._context.socket(zmq.SUB)
        socket.linger = 0
        socket.rcvhwm = 200
        for topic in topics:
            socket.subscribe(topic)
        socket.connect(Endpoint.url(self._where.events))
        return socket

    def watch(self, samples: bool = False, timeout: float | None = None) -> Iterator[Published]:
        """What the server publishes, from now on.

        Args:
            samples: blocks of samples, too.
            timeout: ends where nothing comes for this long [s]; None: never.

        Raises:
            NoServer: what comes is not understood.
        """
        socket = self.subscribe(STATE, NOTICE, *([SAMPLES] if samples else ()))
        try:
            while socket.poll(None if timeout is None else round(timeout * 1e3)):
                yield read_published(*socket.recv_multipart())
        finally:
            socket.close()
