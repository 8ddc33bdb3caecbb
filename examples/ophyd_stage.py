"""An axis of a stage server as a device of ophyd-async, for Bluesky plans.

    pip install ophyd-async bluesky
    stagectl serve --simulate &

    from bluesky import RunEngine, plan_stubs as bps
    x = StageAxis("x"); RunEngine()(bps.mv(x, 10.0))

An example: stagectl does not depend on ophyd-async. Tried on the virtual stage, ophyd-async 0.21.
"""

from __future__ import annotations

import asyncio
from typing import Any

from bluesky.protocols import Location, Stoppable  # type: ignore[import-not-found]
from ophyd_async.core import (  # type: ignore[import-not-found]
    AsyncStatus,
    StandardReadable,
    WatchableAsyncStatus,
    WatcherUpdate,
    soft_signal_r_and_setter,
)

from stagectl.client import AsyncClient
from stagectl.protocol import requests as ask


class StageAxis(StandardReadable, Stoppable):  # type: ignore[misc]
    """One axis; positions in mm."""

    def __init__(self, axis: str, server: str | None = None, name: str = "") -> None:
        self._axis, self._server = axis, server
        self._client: AsyncClient
        with self.add_children_as_readables():
            self.readback, self._set_readback = soft_signal_r_and_setter(float, units="mm")
        super().__init__(name or axis)

    async def connect(self, *args: Any, **more: Any) -> None:
        """Connects to the server, and homes the axes that are not."""
        await super().connect(*args, **more)
        self._client = await AsyncClient(self._server, f"ophyd {self._axis}").__aenter__()
        await self._client.do(ask.Home())
        await self._update()

    async def _update(self) -> float:
        axes = (await self._client.state()).axes
        position = next(a.position for a in axes if a.name == self._axis)
        self._set_readback((position or 0.0) * 1e3)
        return (position or 0.0) * 1e3

    @WatchableAsyncStatus.wrap
    async def set(self, value: float) -> Any:
        """Moves to `value` [mm]."""
        start = await self._update()
        job = await self._client.begin(ask.Move(axis=self._axis, position=value * 1e-3))
        waiting = asyncio.create_task(self._client.wait(job))
        while not waiting.done():
            await asyncio.wait([waiting], timeout=0.1)
            yield WatcherUpdate(await self._update(), start, value, name=self.name, unit="mm")
        await waiting

    async def locate(self) -> Location[float]:
        """Where it is [mm]."""
        position = await self._update()
        return Location(setpoint=position, readback=position)

    @AsyncStatus.wrap
    async def stop(self, success: bool = False) -> None:
        """Quick-stops the stage."""
        await self._client.stop("ophyd")
