"""The bus of a run: the machine's, or with `--simulate` a lock-step bus with virtual drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from drivers.settings import BusSettings
from hil_sim.bus import FaultyWorld, InjectedFault, World
from hil_sim.settings import StageSettings
from hil_sim.stage import VirtualStage
from stagectl.run.request import RunRequest


@contextmanager
def virtual_stage(
    request: RunRequest,
    settings: StageSettings | None,
    bus: BusSettings,
    switched_on: Callable[[VirtualStage, World], object],
) -> Iterator[tuple[BusSettings, Sequence[InjectedFault]]]:
    """Switch on the virtual stage, if there is one.

    Args:
        request: whose seed and faults it has.
        settings: of the virtual stage; None for a real one.
        bus: of the machine.
        switched_on: called with the virtual stage and its world.

    Yields:
        The bus to open, and the faults injected so far.
    """
    if settings is None:
        yield bus, ()
        return
    channel = f"run-{id(request)}"
    simulated = request.simulated
    assert simulated is not None  # noqa: S101 - its settings are given
    stage = VirtualStage(settings, simulated.seed)
    # The world is referenced here, for the registry of worlds does not keep it alive.
    injected: Sequence[InjectedFault] = ()
    if simulated.faults is None:
        world = World(channel)
        stage.attach(world)
    else:
        world = faulty = FaultyWorld(channel, simulated.faults)
        faulty.power_on(stage)
        injected = faulty.injected
    switched_on(stage, world)
    yield replace(bus, interface="lockstep", channel=channel), injected
