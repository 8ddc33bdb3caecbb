"""A client for asyncio; as `Client`, which see for the methods' errors."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any, Self

import zmq
import zmq.asyncio

from stagectl.client import base
from stagectl.client.finding import locate
from stagectl.protocol.endpoint import Endpoint
from stagectl.protocol.requests import Command, GetState, Info, Release, Stop, Take, Wait
from stagectl.protocol.state import Answer, Job, ServerInfo, State
from stagectl.protocol.wire import SAMPLES, unpack

_SLICE = 10.0


class AsyncClient:
    """A connection to a stage server: `async with AsyncClient() as client`.

    Requests of several tasks may be under way at once.

    Attributes:
        info: who serves, once connected.
    """

    def __init__(self, server: str | Endpoint | None = None, name: str | None = None) -> None:
        self._talk = base.Talk(name)
        self._where = locate(server)
        self._context = zmq.asyncio.Context()
        self._commands = self._context.socket(zmq.DEALER)
        self._commands.linger = 0
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._reader: asyncio.Task[None] | None = None
        self.info: ServerInfo

    async def __aenter__(self) -> Self:
        self._commands.connect(Endpoint.url(self._where.commands))
        self._reader = asyncio.create_task(self._read())
        try:
            self.info = ServerInfo.model_validate(await self.ask(Info()))
        except BaseException:
            await self.close()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Disconnect; what was asked for goes on."""
        if self._reader is not None:
            self._reader.cancel()
        self._context.destroy(linger=0)

    async def _read(self) -> None:
        while True:
            data = await self._commands.recv()
            waiting = self._waiting.pop(Answer.model_validate(unpack(data)).id, None)
            if waiting is None or waiting.done():
                continue
            try:
                waiting.set_result(self._talk.answer(data)[1])
            except (base.Refused, base.NoServer) as why:
                waiting.set_exception(why)

    async def ask(self, command: Command, timeout: float = base.ANSWER) -> Any:
        """Ask for something, and return its result; wait `timeout` [s] for it."""
        number, data = self._talk.request(command)
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._waiting[number] = future
        try:
            await self._commands.send(data)
            return await asyncio.wait_for(future, timeout)
        except TimeoutError:
            raise base.NoServer(
                f"the stage server {self._where.name} does not answer ({timeout:g} s)"
            ) from None
        finally:
            self._waiting.pop(number, None)

    async def state(self) -> State:
        """The present state of the stage."""
        return State.model_validate(await self.ask(GetState()))

    async def take(self, force: bool = False) -> None:
        """Take command, so that other clients only watch."""
        self._talk.lease = (await self.ask(Take(force=force)))["lease"]

    async def release(self) -> None:
        """Give command back."""
        if self._talk.lease is not None:
            await self.ask(Release())
            self._talk.lease = None

    async def stop(self, reason: str = "") -> None:
        """Quick-stop all axes and switch their power off."""
        await self.ask(Stop(reason=reason))

    async def begin(self, command: Command) -> Job:
        """Ask for something that takes time, and return its job at once."""
        return Job.model_validate(await self.ask(command))

    async def wait(self, job: Job | int) -> Job:
        """Wait until a job has ended."""
        number = job if isinstance(job, int) else job.id
        while True:
            wait = Wait(job=number, timeout=_SLICE)
            found = Job.model_validate(await self.ask(wait, _SLICE + base.ANSWER))
            if found.ended:
                if found.error is not None:
                    raise base.JobFailed(found)
                return found

    async def do(self, command: Command) -> Job:
        """Ask for something that takes time, and wait until it has ended."""
        return await self.wait(await self.begin(command))

    async def watch(self, samples: bool = False) -> AsyncIterator[base.Published]:
        """What the server publishes, from now on."""
        socket = self._context.socket(zmq.SUB)
        socket.linger = 0
        socket.rcvhwm = 200
        for topic in (b"state", b"notice", *([SAMPLES] if samples else ())):
            socket.subscribe(topic)
        socket.connect(Endpoint.url(self._where.events))
        try:
            while True:
                topic, data = await socket.recv_multipart()
                yield base.read_published(topic, data)
        finally:
            socket.close()
