"""One run from a validated recipe to its files: stage opened, homed, run, disabled, written down.

Joins what the lower layers keep apart: machine and recipe, virtual drives (with `--simulate`) or a
real bus, compensation, engine, bus log, and the run's record. Whatever happens on the way, the
stage ends disabled and what was recorded becomes the recording.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import can

from drivers import AxisFault, DriverError, Stage
from drivers.settings import AxisSettings, BusSettings
from estimation.trajectory import Limits
from hil_sim.bus import FaultyWorld, InjectedFault, World
from hil_sim.stage import VirtualStage
from stagectl.config.mapping import driver_settings, stage_settings
from stagectl.errors import Aborted, ConfigError, RunFault, StagectlError, UnusableInput
from stagectl.history import (
    History,
    StageKey,
    Thermometer,
    file_left_behind,
    open_history,
    plugin_thermometer,
    stage_temperature,
)
from stagectl.recipe import Fiducial, Pair, make_fiducial, plan_from
from stagectl.run.record import RunRecord
from stagectl.run.request import RunRequest, RunResult
from stagectl.run.retries import recover
from stagectl.sequencer import (
    AxisCompensation,
    DriveLimited,
    Engine,
    Event,
    Figures,
    FreshPlaces,
    Mode,
    MovingAxis,
    Places,
    Retrying,
    make_compensation,
)
from stagectl.store import BusLog, recover_left_over

if TYPE_CHECKING:
    from stagectl.maps import ActiveMap


@dataclass(slots=True)
class Listener:
    """Who wants to know what goes on.

    Attributes:
        phase: called with a few words when a phase begins (boot, home, ...).
        event: called with each event of the engine.
        stoppable: called with the function that asks for a controlled stop.
        switched_on: called with the virtual stage and its world (with `--simulate`).
    """

    phase: Callable[[str], object] = field(default=lambda _: None)
    event: Callable[[Event], object] = field(default=lambda _: None)
    stoppable: Callable[[Callable[[str], None]], object] = field(default=lambda _: None)
    switched_on: Callable[[VirtualStage, World], object] = field(default=lambda *_: None)


class _EarlyStop(KeyboardInterrupt):
    """The operator's stop before anything moves; no `except Exception` on its way keeps it."""


@dataclass(frozen=True, slots=True)
class Rig:
    """What stands in for bus, camera and operator, where a run is made again.

    Attributes:
        bus: with a clock of its own.
        fiducial: where the marks are.
        stop: after so many samples the operator asks for a stop, with this reason.
        active: the friction map to go by, as it stood then.
    """

    bus: can.BusABC
    fiducial: Fiducial
    stop: tuple[int, str] | None = None
    active: ActiveMap | None = None


def execute(request: RunRequest, listener: Listener, rig: Rig | None = None) -> RunResult:
    """Run a recipe and write its files.

    Args:
        request: what is to be run.
        listener: who wants to know what goes on.
        rig: in place of the bus that the request names.

    Raises:
        ConfigError: the stage cannot be set up from the files given; nothing has moved.
        StagectlError: the folder cannot be written.
        OSError: likewise.
    """
    recipe, machine = request.recipe, request.machine
    fiducial = make_fiducial(recipe.fiducial, recipe.source) if rig is None else rig.fiducial
    thermometer = plugin_thermometer(machine) if rig is None else None
    try:
        request.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnusableInput(f"{request.folder}: {error.strerror}") from error
    left_over = recover_left_over(request.folder, aside=True)
    if left_over is not None:
        listener.phase(left_over.describe())
    history = None if request.history is None else open_history(request.history, write=True)
    try:
        if history is not None:
            for line in file_left_behind(history, _stage_key(request)):
                listener.phase(line)
        return _execute(request, listener, fiducial, thermometer, rig, history)
    finally:
        if history is not None:
            history.close()


def _execute(
    request: RunRequest,
    listener: Listener,
    fiducial: Fiducial,
    thermometer: Thermometer | None,
    rig: Rig | None,
    history: History | None,
) -> RunResult:
    active = _active_map(request, history) if rig is None else rig.active
    if active is not None:
        listener.phase(f"friction map {active.version.number}")
    listener.phase("preparing the estimator")
    compensation = make_compensation(
        request.machine,
        request.mode,
        request.friction_scale,
        request.truth,
        _known(request, active),
        drift=None if active is None else active.drift,
    )
    bus, axes = driver_settings(request.machine)
    if request.bus is not None:
        bus = replace(bus, interface=request.bus[0], channel=request.bus[1])
    run = _Run(request, listener, compensation, fiducial, rig, history, active)
    if history is not None:
        history.close()  # from here on it is written in a thread, on a connection of its own
    log = BusLog(request.folder / "bus.asc", request.started)
    with _virtual_stage(request, bus, listener, rig) as (used, injected), log:
        run.drive(used, axes, log, thermometer)
        run.note(injected)
    return run.finish(log.digest)


def _active_map(request: RunRequest, history: History | None) -> ActiveMap | None:
    """The map to go by, where there is one and the run learns."""
    if history is None or not request.use_map or request.mode is not Mode.ESTIMATED:
        return None
    from stagectl.maps import load_active
    from stagectl.run.run_history import begins

    return load_active(
        history, _stage_key(request), request.machine, request.recipe.sites,
        begins(history, request),
    )  # fmt: skip


def _stage_key(request: RunRequest) -> StageKey:
    return StageKey(request.machine.name, request.truth is not None)


def _noted(active: ActiveMap) -> dict[str, Any]:
    from stagectl.maps import as_noted

    return as_noted(active)


def _short_of(active: ActiveMap, request: RunRequest) -> list[str]:
    """Where the run will be beyond its map."""
    from stagectl.maps import short_of

    return short_of(active.version, request.recipe.sites)


def _known(request: RunRequest, active: ActiveMap | None) -> Mapping[str, Figures] | None:
    """Friction figures to begin with: those of the run gone on with, else the map's."""
    if request.resumed is not None:
        return request.resumed.friction
    return None if active is None else active.figures


@contextmanager
def _virtual_stage(
    request: RunRequest, bus: BusSettings, listener: Listener, rig: Rig | None
) -> Iterator[tuple[BusSettings, Sequence[InjectedFault]]]:
    """The bus to use, and the faults on it.

    With `--simulate` it is a lock-step one with the truth's virtual drives on it.
    """
    if request.truth is None or rig is not None:
        yield bus, ()
        return
    channel = f"run-{id(request)}"
    stage = VirtualStage(stage_settings(request.truth), request.seed)
    # The world is held here: the registry of worlds does not keep it alive.
    injected: Sequence[InjectedFault] = ()
    if request.faults is None:
        world = World(channel)
        stage.attach(world)
    else:
        world = faulty = FaultyWorld(channel, request.faults)
        faulty.power_on(stage)
        injected = faulty.injected
    listener.switched_on(stage, world)
    yield replace(bus, interface="lockstep", channel=channel), injected


class _Run:
    """The part of a run that has a journal."""

    def __init__(
        self,
        request: RunRequest,
        listener: Listener,
        compensation: tuple[AxisCompensation, ...],
        fiducial: Fiducial,
        rig: Rig | None,
        history: History | None,
        active: ActiveMap | None,
    ) -> None:
        self._request, self._listener, self._compensation = request, listener, compensation
        self._places: Places | None = None
        if active is not None:
            self._places = active.places
            active.places.on_step = self._on_event
        elif request.recipe.excursions:
            self._places = FreshPlaces(
                {
                    name: axis.estimator.friction.coulomb
                    for name, axis in zip(request.machine.axes, compensation, strict=True)
                }
            )
        self._fiducial, self._rig = fiducial, rig
        self._stage: Stage | None = None
        self._engine: Engine | None = None
        self._error: StagectlError | None = None
        self._over = False
        self._record = RunRecord(request, history, None if active is None else _noted(active))
        if active is not None:
            self._record.stage_says(_short_of(active, request))
        self.note = self._record.note

    def drive(
        self,
        bus: BusSettings,
        axes: tuple[AxisSettings, ...],
        log: BusLog,
        thermometer: Thermometer | None,
    ) -> None:
        """Open, home, run and disable the stage; what goes wrong is kept for `finish`."""
        listener = self._listener
        try:
            self._record.start()
            listener.stoppable(self._ask_to_stop)
            listener.phase(f"opening {bus}")
            given = None if self._rig is None else self._rig.bus
            with Stage.open(bus, axes, tap=log.tap, bus_object=given) as stage:
                self._stage = stage
                listener.phase("booting the drives")
                stage.boot()
                self._record.stage_says(stage.limitations)
                for clause in stage.limitations:
                    listener.event(DriveLimited(clause))
                listener.phase("homing")
                stage.home()
                stage.enable()
                self._record.stage_says((*stage.limitations, *stage.notices))
                self._record.temperature = stage_temperature(
                    self._request.machine, stage, thermometer
                )
                self._record.temperature.at(0.0)
                begin = time.perf_counter()
                try:
                    self._go_through(stage, bus.sync_period)
                finally:
                    self._record.wall_time = time.perf_counter() - begin
                listener.phase("disabling")
                stage.disable()
        except DriverError as error:
            self._error = RunFault(str(error))
        except _EarlyStop as stop:
            self._error = Aborted(str(stop))
        except (Aborted, RunFault, ConfigError) as error:
            self._error = error
        except BaseException:
            # Not foreseen: keep what there is, then let it be seen.
            self._record.abandon()
            raise
        finally:
            self._over = True

    def finish(self, log_digest: str | None) -> RunResult:
        """Write what the run leaves, beside the bus log."""
        self._listener.phase("writing recording and report")
        self._record.note_log(log_digest)
        return self._record.finish(self._error)

    def _go_through(self, stage: Stage, period: float) -> None:
        """All that is left of the recipe; a stretch that faults is begun again where that helps."""
        record, recipe = self._record, self._request.recipe
        start = _pair(stage.targets)
        engine = self._engine = Engine(
            stage,
            self._moving_axes([axis.settings for axis in stage.axes]),
            self._fiducial,
            period,
            record.move,
            self._on_event,
            self._places,
        )
        attempt, attempted = 0, record.done
        while True:
            stage.sink = self._sink(engine)
            try:
                engine.run(plan_from(recipe, record.done, start))
                return
            except AxisFault as fault:
                attempt = attempt + 1 if record.done == attempted else 1
                attempted = record.done
                attempt = recover(
                    stage,
                    fault,
                    attempt,
                    self._request.retries,
                    lambda again, why: self._on_event(
                        Retrying(record.done + 1, again, self._request.retries, why)
                    ),
                )
                broken = engine.restart(record.journal.samples)
                if broken is not None:
                    record.broken_off(broken)
            finally:
                stage.sink = None

    def _sink(self, engine: Engine) -> Callable[[Sequence[int]], None]:
        """Where samples go."""
        journal = self._record.journal
        if self._rig is None or self._rig.stop is None:
            return journal.sink
        samples, reason = self._rig.stop

        def sink(sample: Sequence[int]) -> None:
            journal.sink(sample)
            if journal.samples == samples:
                engine.stop(reason)

        return sink

    def _ask_to_stop(self, reason: str) -> None:
        """Moves end in a controlled stop; before them there is nothing to bring to an end.

        A stop that goes on already, for whatever reason, is not broken off.

        Raises:
            _EarlyStop: while the stage is opened, booted or homed; it is stopped on the way out.
        """
        if self._engine is not None:
            self._engine.stop(reason)
        elif not self._over and (self._stage is None or not self._stage.ending):
            raise _EarlyStop(reason)

    def _moving_axes(self, axes: Sequence[AxisSettings]) -> tuple[MovingAxis, ...]:
        """The axes by what their drives have, which may be less than the machine file says."""
        for axis, compensation in zip(axes, self._compensation, strict=True):
            compensation.estimator.saturates_at(axis.peak_force)
        return tuple(
            MovingAxis(
                axis.name,
                Limits(axis.velocity, axis.acceleration, axis.jerk),
                axis.increment,
                compensation,
                axis.following_error,
                self._request.machine.axes[axis.name].plant.mass,
            )
            for axis, compensation in zip(axes, self._compensation, strict=True)
        )

    def _on_event(self, event: Event) -> None:
        self._record.event(event)
        self._listener.event(event)


def _pair(position: tuple[float, ...]) -> Pair:
    return position[0], position[1]
