"""A run as a whole, from a validated recipe to its files.

Everything is checked, kernels are compiled (`prepare`) and the bus is open before any file is made;
a `Session` then operates the stage. The history gets the run once the drives have answered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

import can

from drivers.canopen import open_bus
from drivers.errors import BusOpenError
from drivers.settings import BusSettings
from hil_sim.bus import FaultyWorld, InjectedFault, World
from hil_sim.settings import StageSettings
from hil_sim.stage import VirtualStage
from stagectl.errors import RunFault, UnusableInput, unusable
from stagectl.history import existing_history, file_unfiled_runs, open_history
from stagectl.maps import ActiveMap
from stagectl.measurement import (
    Measurement,
    load_measurement,
    measure_virtual_stage,
    response_path,
)
from stagectl.run.access import OwnStage
from stagectl.run.checks import Checked, Substitutes, check, is_mapped, stage_key
from stagectl.run.compilation import compiled_by_two
from stagectl.run.listener import Listener
from stagectl.run.recorded.resume import recorded_measurement
from stagectl.run.request import RunRequest, RunResult
from stagectl.run.session import Session
from stagectl.sequencer import AxisCompensation, make_compensation
from stagectl.store import RECORDING_NAME, recover_left_over


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
    truth = found.truth if substitutes is None else None
    with virtual_stage(request, truth, found.bus, listener) as (used, injected):
        listener.phase(f"opening {used}")
        with _open_bus(used, substitutes) as opened:
            _prepare_files(request, listener)
            session = Session(request, listener, found, compensation, substitutes)
            session.operate(OwnStage(used, found.axes, opened), injected)
            return session.finish()


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
    with unusable(BusOpenError):
        return open_bus(bus)


def make_session(request: RunRequest, listener: Listener) -> Session:
    """A run's session on a stage that is kept ready, prepared up to its journal.

    Raises:
        ConfigError, UnusableInput, StagectlError: as `prepare`, or the folder or the history cannot
            be used.
    """
    file_earlier_runs(request, listener.phase)
    found, compensation = prepare(request, listener.phase)
    _prepare_files(request, listener)
    return Session(request, listener, found, compensation, None)


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


def prepare(
    request: RunRequest,
    announce: Callable[[str], object] = lambda _: None,
    substitutes: Substitutes | None = None,
) -> tuple[Checked, tuple[AxisCompensation, ...]]:
    """Check the request, then make what takes long: the compensation of each axis.

    Args:
        request: what to run.
        announce: called with a few words when something that takes long begins.
        substitutes: of a replay, or of a test.

    Raises:
        ConfigError, UnusableInput, StagectlError: as `check`.
    """
    found = check(request, substitutes)
    if found.active is not None:
        announce(f"friction map {found.active.version.number}")
    announce("preparing the estimator")
    return found, _make_compensation(request, found.active)


def file_earlier_runs(request: RunRequest, announce: Callable[[str], object]) -> None:
    """File what earlier runs of the stage left in their folders, where there is a history yet.

    Args:
        request: of the run that begins.
        announce: called with a line for each run that was filed.

    Raises:
        StagectlError: the history cannot be written.
    """
    with existing_history(request.history) as existing:
        if existing is None or request.history is None:
            return
    with closing(open_history(request.history, write=True)) as history:
        for line in file_unfiled_runs(history, stage_key(request)):
            announce(line)


def _make_compensation(
    request: RunRequest, active: ActiveMap | None
) -> tuple[AxisCompensation, ...]:
    """Compensation that starts from the figures of the resumed run, else from the map's."""
    known = None if active is None else active.figures
    if request.resumed is not None:
        known = dict(request.resumed.friction)
    return make_compensation(
        request.machine, request.host.mode, request.host.friction_scale, request.truth, known,
        None if active is None else active.drift, is_mapped(request, active),
        bool(request.recipe.excursions or request.recipe.slipped),
    )  # fmt: skip


def find_measurement(
    request: RunRequest,
    given: Path | None,
    machine: Path | None,
    resume: Path | None,
    announce: Callable[[str], object],
) -> Measurement | None:
    """The measurement of the stage by which the observers are designed; None without one.

    Args:
        request: what to run; checked first, for measuring a virtual stage takes a second.
        given: file of the measurement; None: the run's that is resumed, a new one of a virtual
            stage, or the one beside the machine file.
        machine: machine file; None: the packaged one.
        resume: folder of the run that is resumed, or None.
        announce: called with what takes long, or went wrong.

    Raises:
        ConfigError, UnusableInput, StagectlError: a file cannot be used, or as `check`.
    """
    check(request)
    if given is not None:
        return load_measurement(given)
    recorded = None if resume is None else recorded_measurement(resume / RECORDING_NAME)
    truth = request.truth
    if truth is not None and recorded is not None:
        return recorded
    if truth is not None:
        try:
            with compiled_by_two(request.machine, truth, lambda _: None):
                return measure_virtual_stage(request.machine, truth, announce)
        except (RunFault, UnusableInput) as fault:
            announce(f"the virtual stage could not be measured, so it has no observer: {fault}")
            return None
    beside = response_path(request.machine, machine)
    return load_measurement(beside) if beside.exists() else recorded
