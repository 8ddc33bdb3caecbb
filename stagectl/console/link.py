"""The console's connection to the stage server, made again whenever it is lost.

It watches and stops; what else browsers ask for goes by connections of their own (`session`).
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any

from stagectl.client import AsyncClient, NoServer
from stagectl.console.samples import SampleRing
from stagectl.errors import StagectlError
from stagectl.protocol.endpoint import Endpoint
from stagectl.protocol.requests import GetEvents
from stagectl.protocol.state import Notice, ServerInfo, State

SILENT = 3.0
"""A server that publishes nothing for this long is taken for lost [s]; it does so at 10 Hz."""
AGAIN = 0.3
MOST_NOTICES = 1000


class StageLink:
    """Watches one server.

    Args:
        where: its sockets.

    Attributes:
        info: who serves, or None where none does.
        state: its latest state as plain values.
        notices: the latest of them, oldest first.
        ring: the latest samples.
        why: why there is no server, or "".
        last_run: recipe of the run that was last seen under way, or None.
        generation: counts connections, so that a page knows that notices and samples begin anew.
    """

    def __init__(self, where: Endpoint) -> None:
        self.where = where
        self.info: ServerInfo | None = None
        self.state: dict[str, Any] = {}
        self.notices: deque[Notice] = deque(maxlen=MOST_NOTICES)
        self.ring = SampleRing()
        self.why = ""
        self.generation = 0
        self.last_run: str | None = None
        self._client: AsyncClient | None = None

    async def run(self) -> None:
        """Watch until cancelled."""
        while True:
            try:
                await self._watch()
            except (StagectlError, TimeoutError, OSError) as why:
                self.why = str(why) or "the stage server is silent"
            finally:
                self._client, self.info, self.state = None, None, {}
            await asyncio.sleep(AGAIN)

    async def _watch(self) -> None:
        async with AsyncClient(self.where, "console") as client:
            published = client.watch(samples=True).__aiter__()
            waiting = asyncio.ensure_future(anext(published))  # subscribed before past is asked for
            try:
                past = await client.ask(GetEvents())
                self.notices.clear()
                self.notices.extend(Notice.model_validate(each) for each in past)
                self.ring = SampleRing(client.info.control_period / client.info.period)
                self._take(await client.state())
                self.generation += 1
                self.why, self.info, self._client = "", client.info, client
                while True:
                    self._take(await asyncio.wait_for(waiting, SILENT))
                    waiting = asyncio.ensure_future(anext(published))
            finally:
                waiting.cancel()

    def _take(self, published: Any) -> None:
        if isinstance(published, State):
            self.state = published.model_dump(mode="json")
            self.last_run = None if published.run is None else published.run.recipe
        elif isinstance(published, Notice):
            if not self.notices or published.number > self.notices[-1].number:
                self.notices.append(published)
        else:
            self.ring.append(published)

    async def stop(self, reason: str) -> None:
        """Stop the stage.

        Raises:
            NoServer: none answers.
            Refused: the server refuses.
        """
        if self._client is None:
            raise NoServer(self.why or "no stage server")
        await self._client.stop(reason)
