"""A server from start to end."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

from stagectl.errors import StagectlError, failure_to_write
from stagectl.protocol.endpoint import Endpoint
from stagectl.run.compilation import compiled_by_two
from stagectl.sequencer.compensation import compile_kernels
from stagectl.server.api import Api
from stagectl.server.handover import Handover
from stagectl.server.keeper import StageKeeper
from stagectl.server.metrics import Metrics
from stagectl.server.service import Service
from stagectl.server.setup import Setup

_SWITCH = 2e-4
"""Longest turn of a thread while another one waits [s]; Python's own is 5 ms, five SYNCs."""
_END = 10.0
"""Longest wait for the axes to be disabled at the end [s]."""


def serve(
    setup: Setup,
    endpoint: Endpoint,
    group: int | None,
    announce: Callable[[str], object],
    stoppable: Callable[[Callable[[], None]], object],
    metrics: int | None = None,
) -> None:
    """Serve until it is asked to end.

    Args:
        setup: what to serve.
        endpoint: where.
        group: number of the group that is let in, or None.
        announce: called with a few words as it starts, and where it can be reached.
        stoppable: called with the function that ends it.
        metrics: port on this computer for Prometheus, or None.

    Raises:
        UnusableInput, RunFault, StagectlError: it cannot serve, or the stage has gone.
    """
    setup.check()
    try:
        setup.data.mkdir(parents=True, exist_ok=True)
    except OSError as why:
        raise failure_to_write(f"{setup.data}: cannot create", why) from why
    api = Api(endpoint, group, None if metrics is None else Metrics(metrics))
    try:
        truth = None if setup.simulated is None else setup.simulated.truth
        with compiled_by_two(setup.machine, truth, announce):
            compile_kernels(setup.machine, estimator=True)
        _serve(setup, api, announce, stoppable)
    finally:
        api.close()


def _serve(
    setup: Setup,
    api: Api,
    announce: Callable[[str], object],
    stoppable: Callable[[Callable[[], None]], object],
) -> None:
    handover = Handover()
    keeper = StageKeeper(setup.bus, setup.axes, setup.simulated, handover, setup.hold_limit)
    service = Service(setup, keeper, handover, api.publish)
    announce("booting the drives")
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    keeper.start()
    try:
        keeper.ready.wait()
        if keeper.stage is not None:
            stoppable(api.end)
            info = service.info()
            announce(f"serving {info.machine} on {info.bus} as '{api.name}'; stop with Ctrl-C")
            api.serve(service, keeper, handover)
            service.end()
    finally:
        keeper.end()
        keeper.join(_END)
        sys.setswitchinterval(before)
    if setup.statistics is not None and keeper.world is not None:
        np.savez(setup.statistics, delays=keeper.world.delays, turnarounds=keeper.world.turnarounds)
    if keeper.failure is not None:
        raise keeper.failure
    if keeper.is_alive():
        raise StagectlError("the stage's thread does not end; the drives stop by themselves")
