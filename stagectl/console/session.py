"""One page of one browser: what it is sent, what it asks for, and that its motion ends with it.

Text frames are JSON. From the page: `{"id": n, "ask": command}` with a command of the protocol, or
`{"samples": bool}`. To the page: `{"id": n, "result": ...}` or `{"id": n, "refused": ...}`, and
`{"changed": {...}}` with the parts of the state that have changed. Binary frames are samples.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from stagectl.client import AsyncClient, NoServer, Refused
from stagectl.console.bodies import BadBody, parse_json
from stagectl.console.folder import NoSuchFile
from stagectl.console.link import StageLink
from stagectl.console.recipes import Recipes, refuse_files_elsewhere
from stagectl.console.samples import MOST_IN_FRAME, columns, frame
from stagectl.errors import StagectlError, UnusableInput
from stagectl.protocol import requests
from stagectl.protocol.requests import Command, Jog, Stop
from stagectl.protocol.wire import one_problem
from stagectl.rates import Rates

FRAME = 0.04
"""Between two frames to a page [s]."""
RENEWAL = 0.2
"""A jog that the page has not renewed for this long has ended [s]; the server's limit, too."""
RENEW_LEASE = 1.0
MOST_UNDER_WAY = 16
SLOW = 30.0
"""A page that takes no frame for this long is disconnected [s]."""
_ANYBODY = (requests.GetState, requests.GetEvents, requests.CheckRecipe)
_IN_COMMAND = (
    requests.Enable, requests.Disable, requests.Home, requests.Move, requests.Jog,
    requests.QueueAdd, requests.QueueRemove, requests.QueueReorder, requests.QueueStart,
    requests.QueueHalt, requests.Pause, requests.Resume, requests.Abort, requests.Acknowledge,
)  # fmt: skip
_COMMAND: TypeAdapter[Command] = TypeAdapter(Command)
_WithRecipe = requests.CheckRecipe | requests.QueueAdd
_numbers = itertools.count(1)


@dataclass
class _Hold:
    """A jog that the page keeps alive: `begin` starts it, and what comes too late does not."""

    axis: str = ""
    until: float = 0.0

    def accepts(self, jog: Jog, begins: bool, now: float) -> bool:
        """Whether to pass a jog on; a renewal that was held up must not start motion again."""
        if jog.velocity == 0:
            self.until = 0.0
            return True
        if not begins and (jog.axis != self.axis or now > self.until):
            return False
        self.axis, self.until = jog.axis, now + RENEWAL
        return True


class Session:
    """A page's connection.

    Args:
        socket: not yet accepted.
        link: to the server.
        operator: name of who sits there.
        recipes: of which a page may send the texts.
        twin: the machine file that a diagnosis has written, by the diagnosis' name.
        more: further parts of the state, by name, asked for at every frame.
    """

    def __init__(
        self, socket: WebSocket, link: StageLink, operator: str, recipes: Recipes,
        twin: Callable[[str], requests.MachineFile], more: Callable[[], dict[str, Any]],
    ) -> None:  # fmt: skip
        self._socket, self._link, self._more = socket, link, more
        self._operator, self._recipes, self._twin = operator, recipes, twin
        self._name = f"{operator} (console {next(_numbers)})"[-64:]
        self._client: AsyncClient | None = None
        self._generation, self._taken = -1, 0.0
        self._hold = _Hold()
        self._rates = Rates(rate=60, burst=120)
        self._tasks: set[asyncio.Task[None]] = set()
        self._sent: dict[str, Any] = {}
        self._notice = self._next_sample = 0
        self._wants_samples = False
        self._sending = asyncio.Lock()

    async def run(self) -> None:
        """Until the page goes away; then its motion is ended and command given back."""
        await self._socket.accept()
        work = [asyncio.create_task(part()) for part in (self._send, self._receive, self._renew)]
        try:
            await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
        finally:
            await asyncio.shield(self._end(work))
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await self._socket.close()

    async def _end(self, work: list[asyncio.Task[None]]) -> None:
        tasks = [*work, *self._tasks]
        for task in tasks:
            task.cancel()
        await self._leave()  # at once, since an axis may be moving
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._leave()  # again, since command may just have been taken

    async def _leave(self) -> None:
        client, self._client = self._client, None
        if client is None:
            return
        with contextlib.suppress(StagectlError, ValidationError):
            if self._hold.until:
                await client.ask(Jog(axis=self._hold.axis, velocity=0.0), 1.0)
            await client.ask(requests.Release(), 1.0)
        await client.close()

    async def _renew(self) -> None:
        """Keeps the lease: as long as this page is connected, not longer."""
        while True:
            await asyncio.sleep(RENEW_LEASE)
            client = self._client
            if client is None:
                continue
            holder = (self._link.state.get("lease") or {}).get("holder")
            is_known = bool(self._link.state) and time.monotonic() > self._taken + RENEW_LEASE
            if self._generation != self._link.generation or (is_known and holder != self._name):
                self._client = None  # taken by another, or the server is another one
                await client.close()
                continue
            with contextlib.suppress(NoServer, Refused):
                await client.ask(requests.GetState(), RENEW_LEASE)

    # What the page asks for.

    async def _receive(self) -> None:
        while True:
            try:
                text = await self._socket.receive_text()
            except WebSocketDisconnect:
                return
            except KeyError:  # a binary frame
                return await self._socket.close(1003)
            try:
                message = parse_json(text)
            except BadBody:
                return await self._socket.close(1007)
            if not isinstance(message, dict):
                return await self._socket.close(1007)
            is_stop = message.get("ask") == {"op": "stop"}
            if not is_stop and not self._rates.allows(""):
                return await self._socket.close(1008)
            if message.keys() == {"samples"}:
                self._wants_samples = message["samples"] is True
                self._next_sample = self._link.ring.end
            elif not self._begin(message, is_stop):
                return await self._socket.close(1007)

    def _begin(self, message: dict[str, Any], is_stop: bool) -> bool:
        """Begin with a request; False where it is not one."""
        number, begins = message.get("id"), message.get("begin", False)
        if type(number) is not int or type(begins) is not bool:
            return False
        if message.keys() - {"id", "ask", "begin"} or "ask" not in message:
            return False
        try:
            command = _COMMAND.validate_json(json.dumps(message["ask"]), strict=True)
        except ValidationError as why:
            self._start(self._answer(number, refused=_refusal("invalid", one_problem(why))))
            return True
        if len(self._tasks) >= MOST_UNDER_WAY and not is_stop:
            self._start(self._answer(number, refused=_refusal("busy", "too much under way")))
            return True
        if isinstance(command, Jog) and not self._hold.accepts(command, begins, time.monotonic()):
            self._start(self._answer(number, refused=_refusal("busy", "this jog has ended")))
            return True
        self._start(self._do(number, command))
        return True

    def _start(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _do(self, number: int, command: Command) -> None:
        try:
            result = await self._ask(command)
        except Refused as why:
            await self._answer(number, refused=why.refusal.model_dump(mode="json"))
        except (StagectlError, NoSuchFile) as why:
            await self._answer(number, refused=_refusal("unavailable", str(why)))
        else:
            await self._answer(number, result=result)

    async def _ask(self, command: Command) -> Any:
        if isinstance(command, Stop):
            return await self._link.stop(f"by {self._operator}, in the console")
        if isinstance(command, requests.Take):
            return await self._take(command.force)
        if isinstance(command, requests.Release):
            client, self._client = self._client, None
            if client is not None:
                with contextlib.suppress(Refused):
                    await client.release()
                await client.close()
            return None
        if isinstance(command, requests.CheckRecipe | requests.QueueAdd):
            command = await asyncio.to_thread(self._placed, command)
        if isinstance(command, _ANYBODY):
            async with AsyncClient(self._link.where, self._name) as watching:
                return await watching.ask(command, 30.0)
        if not isinstance(command, _IN_COMMAND):
            raise StagectlError(f"{command.op}: not from the console")
        if self._client is None:
            raise StagectlError("take command first")
        return await self._client.ask(command, 30.0)

    def _placed(self, command: _WithRecipe) -> _WithRecipe:
        """With the true path of the recipe and of the twin that it names, and no other path."""
        if isinstance(command, requests.QueueAdd) and (
            command.folder or command.resume or command.options.history
        ):
            raise UnusableInput("folder, resume and history: not from the console")
        source = self._recipes.path(command.source)
        refuse_files_elsewhere(command.recipe, source)
        placed: dict[str, Any] = {"source": str(source)}
        if isinstance(command, requests.QueueAdd) and command.machine is not None:
            if command.machine.text:  # it could name code to be run
                raise UnusableInput("machine: by the name of its diagnosis only")
            placed["machine"] = self._twin(command.machine.source)
        return command.model_copy(update=placed)

    async def _take(self, force: bool) -> None:
        if self._client is not None:
            await self._client.take(force)
            return
        client = await AsyncClient(self._link.where, self._name).__aenter__()
        try:
            await client.take(force)
        except BaseException:
            await client.close()
            raise
        self._client, self._generation = client, self._link.generation
        self._taken = time.monotonic()

    async def _answer(self, number: int, **answer: Any) -> None:
        await self._text({"id": number, **answer})

    # What the page is sent.

    async def _send(self) -> None:
        while True:
            changed = self._changed()
            if changed:
                await self._text({"changed": changed})
            if self._wants_samples and self._link.ring.end != self._next_sample:
                stretch = self._link.ring.since(self._next_sample, MOST_IN_FRAME)
                self._next_sample = stretch.first + stretch.values.shape[1]
                await self._bytes(frame(stretch))
            await asyncio.sleep(FRAME)

    def _changed(self) -> dict[str, Any]:
        link = self._link
        parts = dict(link.state)
        run = parts.get("run")
        if run is not None:  # thousands of sites, sent once and not at every phase
            parts["sites"] = run["sites"]
            parts["run"] = {k: v for k, v in run.items() if k != "sites"}
        info = None if link.info is None else link.info.model_dump(mode="json")
        parts |= {"server": info, "why": link.why, "generation": link.generation}
        parts["me"] = {"name": self._name, "commands": self._client is not None
                       and (parts.get("lease") or {}).get("holder") == self._name}  # fmt: skip
        parts["columns"] = columns([axis["name"] for axis in info["axes"]]) if info else []
        parts |= self._more()
        changed = {k: v for k, v in parts.items() if k not in self._sent or self._sent[k] != v}
        changed |= dict.fromkeys(self._sent.keys() - parts.keys())
        if "generation" in changed:
            self._notice = self._next_sample = 0
        notices = [n for n in link.notices if n.number > self._notice]
        self._sent = parts
        if notices:
            self._notice = notices[-1].number
            changed["notices"] = [notice.model_dump(mode="json") for notice in notices]
        return changed

    async def _text(self, message: dict[str, Any]) -> None:
        text = json.dumps(message, separators=(",", ":"), default=_plain)
        async with self._sending:
            await asyncio.wait_for(self._socket.send_text(text), SLOW)

    async def _bytes(self, data: bytes) -> None:
        async with self._sending:
            await asyncio.wait_for(self._socket.send_bytes(data), SLOW)


def _refusal(kind: str, text: str) -> dict[str, Any]:
    return {"kind": kind, "text": text, "problems": []}


def _plain(value: Any) -> Any:
    return value.hex() if isinstance(value, bytes) else str(value)
