"""A run as a whole, from a validated recipe to its files.

Everything is checked (`prepare`) and the bus is open before any file is made; a `Session` then
operates the stage. The history gets the run once the drives have answered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace

import can

from drivers.canopen import open_bus
from drivers.errors import BusOpenError
from drivers.settings import BusSettings
from hil_sim.bus import FaultyWorld, InjectedFault, World
from hil_sim.settings import StageSettings
from hil_sim.stage import VirtualStage
from stagectl.errors import UnusableInput
from stagectl.history import open_history
from stagectl.run.checks import Substitutes
from stagectl.run.compilation import compiled_by_two
from stagectl.run.listener import Listener
from stagectl.run.prepare import file_earlier_runs, prepare
from stagectl.run.request import RunRequest, RunResult
from stagectl.run.session import Session
from stagectl.store import recover_left_over


def execute(
    request: RunRequest, listener: Listener, substitutes: Substitutes | None = None
) -> RunResult:
    """Run a recipe and write its files.

    Args:
        request: what to run.
        listener: called as the run proceeds.
        substitutes: of a replay, or of a test.

    Raises:
        ConfigError: the stage cannot be set up from the files given; nothing has moved.
        StagectlError: the folder or the history cannot be used; nothing has moved.
        OSError: likewise.
    """
    with compiled_by_two(request.machine, request.truth, listener.phase):
        return _execute(request, listener, substitutes)


def _execute(request: RunRequest, listener: Listener, substitutes: Substitutes | None) -> RunResult:
    if substitutes is None:
        file_earlier_runs(request, listener.phase)
    found, compensation = prepare(request, listener.phase, substitutes)
    bus = found.bus
    if request.bus is not None:
        bus = replace(bus, interface=request.bus[0], channel=request.bus[1])
    simulated = (
        virtual_stage(request, found.truth, bus, listener)
        if substitutes is None
        else nullcontext((bus, ()))
    )
    with simulated as (used, injected):
        listener.phase(f"opening {used}")
        with _open_bus(used, substitutes) as opened:
            _prepare_files(request, listener)
            session = Session(request, listener, found, compensation, substitutes)
            return session.run(used, opened, injected)


@contextmanager
def virtual_stage(
    request: RunRequest, settings: StageSettings | None, bus: BusSettings, listener: Listener
) -> Iterator[tuple[BusSettings, Sequence[InjectedFault]]]:
    """Switch on the virtual stage, if there is one.

    Args:
        request: whose seed and faults it has.
        settings: of the virtual stage; None for a real one.
        bus: of the machine.
        listener: called with the virtual stage and its world.

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
    listener.switched_on(stage, world)
    yield replace(bus, interface="lockstep", channel=channel), injected


def _open_bus(
    bus: BusSettings, substitutes: Substitutes | None
) -> AbstractContextManager[can.BusABC]:
    """The open bus, closed at the end.

    Raises:
        UnusableInput: there is no such bus.
    """
    if substitutes is not None:
        return nullcontext(substitutes.bus)
    try:
        return open_bus(bus)
    except BusOpenError as error:
        raise UnusableInput(str(error)) from error


def _prepare_files(request: RunRequest, listener: Listener) -> None:
    """Make folder and history; recover the journal of a killed run in the folder."""
    try:
        request.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnusableInput(f"{request.folder}: {error.strerror}") from error
    left_over = recover_left_over(request.folder, aside=True)
    if left_over is not None:
        listener.phase(left_over.describe())
    if request.history is not None:
        open_history(request.history, write=True).close()
