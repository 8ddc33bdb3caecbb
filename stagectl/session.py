"""One run from a validated recipe to its files: stage opened, homed, run, disabled, written down.

Joins what the lower layers keep apart: machine and recipe, virtual drives (with `--simulate`) or a
real bus, compensation, engine, journal, bus log, summary and report. Whatever happens on the way,
the stage ends disabled and what was recorded becomes the recording.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from drivers import DriverError, Stage
from drivers.settings import AxisSettings, BusSettings
from estimation.trajectory import Limits
from hil_sim.fault_rules import Injected
from hil_sim.fault_world import FaultyWorld
from hil_sim.faults import FaultPlan
from hil_sim.stage import VirtualStage
from hil_sim.world import World
from sim2real.recording import Recording
from stagectl.compensation import AxisCompensation, Mode, make_compensation
from stagectl.config.machine import Machine
from stagectl.config.mapping import driver_settings, stage_settings
from stagectl.errors import Aborted, ConfigError, RunFault, StagectlError, UnusableInput
from stagectl.recipe.fiducial import Fiducial, make_fiducial
from stagectl.recipe.model import Recipe
from stagectl.recipe.plan import plan
from stagectl.report.page import write_report
from stagectl.sequencer.engine import Engine
from stagectl.sequencer.events import Event, FrictionUpdated
from stagectl.sequencer.mover import MovingAxis
from stagectl.sequencer.verdict import SiteVerdict, judge
from stagectl.store.bus_log import BusLog
from stagectl.store.journal import AxisScaling, Journal, JournalHeader
from stagectl.store.recovery import recover, recover_left_over
from stagectl.store.summary import (
    FrictionEntry,
    ParameterEstimate,
    RunFacts,
    build_summary,
    write_summary,
)

OUTPUTS = ("recording.h5", "summary.json", "report.html", "bus.asc")
"""Files that a run writes."""
UNITS = {"coulomb": "N", "viscous": "N s/m", "stiffness": "N/m", "attraction": "N/s"}
"""Friction figures of a summary and their units."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What is to be run.

    Attributes:
        recipe: checked against `machine`.
        machine: what the host believes.
        truth: what the virtual stage is; None for the machine's bus.
        bus: (interface, channel) instead of the machine's.
        mode: of compensation.
        friction_scale: of the friction figures the host starts from.
        seed: of the virtual stage's noise and repeatability.
        folder: for the files.
        started: time of the run, with zone.
        faults: of bus and drives, on the virtual stage only; None for none.
    """

    recipe: Recipe
    machine: Machine
    truth: Machine | None
    bus: tuple[str, str] | None
    mode: Mode
    friction_scale: float
    seed: int
    folder: Path
    started: datetime
    faults: FaultPlan | None = None


@dataclass(frozen=True, slots=True)
class RunResult:
    """How it went.

    Attributes:
        summary: as in `summary.json`.
        recording: of the run, None when it ended before its first sample.
        error: what ended it early, else None.
        first_update: axis -> index of the recording's move after whose update its friction model
            was first learned; absent where it never was.
        verdicts: pass or fail per site, where the recipe has limits.
    """

    summary: dict[str, Any]
    recording: Recording | None
    error: StagectlError | None
    first_update: dict[str, int]
    verdicts: tuple[SiteVerdict, ...]


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


def execute(request: RunRequest, listener: Listener) -> RunResult:
    """Run a recipe and write its files.

    Raises:
        ConfigError: the stage cannot be set up from the files given; nothing has moved.
        StagectlError: the folder cannot be written.
        OSError: likewise.
    """
    fiducial = make_fiducial(request.recipe.fiducial)
    try:
        request.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UnusableInput(f"{request.folder}: {error.strerror}") from error
    left_over = recover_left_over(request.folder, aside=True)
    if left_over is not None:
        listener.phase(left_over.describe())
    listener.phase("preparing the estimator")
    compensation = make_compensation(
        request.machine, request.mode, request.friction_scale, request.truth
    )
    bus, axes = driver_settings(request.machine)
    if request.bus is not None:
        bus = replace(bus, interface=request.bus[0], channel=request.bus[1])
    _put_aside(request.folder)
    run = _Run(request, listener, compensation, fiducial)
    with (
        _virtual_stage(request, bus, listener) as (used, injected),
        BusLog(request.folder / "bus.asc", request.started) as log,
    ):
        run.drive(used, axes, log)
        run.note(injected)
    return run.finish()


@contextmanager
def _virtual_stage(
    request: RunRequest, bus: BusSettings, listener: Listener
) -> Iterator[tuple[BusSettings, Sequence[Injected]]]:
    """The bus to use, and the faults on it.

    With `--simulate` it is a lock-step one with the truth's virtual drives on it.
    """
    if request.truth is None:
        yield bus, ()
        return
    channel = f"run-{id(request)}"
    stage = VirtualStage(stage_settings(request.truth), request.seed)
    # The world is held here: the registry of worlds does not keep it alive.
    injected: Sequence[Injected] = ()
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
    ) -> None:
        self._request, self._listener, self._compensation = request, listener, compensation
        self._fiducial = fiducial
        self._engine: Engine | None = None
        machine = request.machine
        self._journal = Journal(
            request.folder,
            JournalHeader(
                machine.text,
                request.recipe.text,
                request.started.isoformat(),
                tuple(
                    AxisScaling(name, 1e-9, axis.drive.rated_force / 1000.0)
                    for name, axis in machine.axes.items()
                ),
            ),
        )
        self._friction: list[FrictionEntry] = []
        self._first_update: dict[str, int] = {}
        self._moves = 0
        self._wall_time = 0.0
        self._error: StagectlError | None = None

    def drive(self, bus: BusSettings, axes: tuple[AxisSettings, ...], log: BusLog) -> None:
        """Open, home, run and disable the stage; what goes wrong is kept for `finish`."""
        listener, recipe = self._listener, self._request.recipe
        try:
            listener.stoppable(self._ask_to_stop)
            listener.phase(f"opening {bus}")
            missed = self._request.machine.bus.max_missed
            with Stage.open(bus, axes, tap=log.tap, max_missed=missed) as stage:
                listener.phase("booting the drives")
                stage.boot()
                listener.phase("homing")
                stage.home()
                stage.enable()
                stage.sink = self._journal.sink
                engine = self._engine = Engine(
                    stage,
                    self._moving_axes(axes),
                    self._fiducial,
                    bus.sync_period,
                    self._on_move,
                    self._on_event,
                )
                steps = plan(recipe, _pair(stage.targets))
                begin = time.perf_counter()
                try:
                    engine.run(steps)
                finally:
                    self._wall_time = time.perf_counter() - begin
                    stage.sink = None
                listener.phase("disabling")
                stage.disable()
        except DriverError as error:
            self._error = RunFault(str(error))
        except (Aborted, RunFault, ConfigError) as error:
            self._error = error
        except BaseException:
            # Not foreseen: keep what there is, then let it be seen.
            self._journal.finish("fault", "internal error")
            recover(self._journal.path, overwrite=True)
            raise

    def _ask_to_stop(self, reason: str) -> None:
        """Moves end in a controlled stop; before them there is nothing to bring to an end.

        Raises:
            Aborted: while the stage is opened, booted or homed; it is stopped on the way out.
        """
        if self._engine is None:
            raise Aborted(reason)
        self._engine.stop(reason)

    def note(self, injected: Sequence[Injected]) -> None:
        """Who reads the recording is to know that these faults were made."""
        for entry in injected:
            self._journal.event(
                "injected_fault",
                fault=repr(entry.fault),
                count=entry.count,
                first=entry.first_ns * 1e-9 if entry.count else None,
            )

    def finish(self) -> RunResult:
        """Journal to recording, summary and report."""
        request, machine = self._request, self._request.machine
        error = self._error
        outcome = (
            "completed" if error is None else "aborted" if isinstance(error, Aborted) else "fault"
        )
        fault = str(error) if outcome == "fault" else None
        self._journal.finish(outcome, fault)
        self._listener.phase("writing the recording")
        content = recover(self._journal.path, overwrite=True).content
        recording = None if content is None else content.recording
        period = machine.bus.sync_period
        control_period = next(iter(machine.axes.values())).drive.control_period
        facts = RunFacts(
            recipe=request.recipe.name,
            machine=machine.name,
            compensation=request.mode.value,
            seed=request.seed,
            simulated=request.truth is not None,
            lot=request.recipe.lot,
            duration=0.0 if recording is None else round(len(recording) * period, 9),
            wall_time=self._wall_time,
            outcome=outcome,
            fault=fault,
        )
        summary = build_summary(
            _empty(machine, request) if recording is None else recording,
            facts,
            self._friction,
            control_period=control_period,
            sync_period=period,
            ledger=None if content is None else content.ledger,
        )
        write_summary(summary, request.folder / "summary.json")
        if recording is not None:
            self._listener.phase("writing the report")
            write_report(
                request.folder / "report.html", recording, summary, control_period=control_period
            )
        verdicts = (
            ()
            if recording is None
            else judge(
                recording,
                request.recipe.limits,
                request.recipe.settle.window,
                control_period,
                period,
            )
        )
        return RunResult(summary, recording, error, dict(self._first_update), verdicts)

    def _moving_axes(self, axes: tuple[AxisSettings, ...]) -> tuple[MovingAxis, ...]:
        return tuple(
            MovingAxis(
                axis.name,
                Limits(axis.velocity, axis.acceleration, axis.jerk),
                axis.increment,
                compensation,
                axis.following_error,
            )
            for axis, compensation in zip(axes, self._compensation, strict=True)
        )

    def _on_move(self, move: Any) -> None:
        self._moves += 1
        self._journal.move(move)

    def _on_event(self, event: Event) -> None:
        if isinstance(event, FrictionUpdated):
            self._note_friction(event)
        self._listener.event(event)

    def _note_friction(self, event: FrictionUpdated) -> None:
        estimate, friction = event.estimate, event.estimate.friction
        sigma = dict(estimate.sigma)
        rate = sigma.pop("relaxation_rate")
        # C = rate Fc: relative variances add.
        sigma["attraction"] = (
            friction.attraction
            * ((rate / friction.relaxation_rate) ** 2 + (sigma["coulomb"] / friction.coulomb) ** 2)
            ** 0.5
        )
        entry = FrictionEntry(
            site=event.site,
            axis=event.axis,
            accepted=estimate.accepted,
            reason=estimate.reason,
            compute_time=event.compute_time,
            parameters={
                name: ParameterEstimate(float(getattr(friction, name)), sigma[name], unit)
                for name, unit in UNITS.items()
            },
        )
        self._friction.append(entry)
        self._journal.event(
            "friction",
            site=entry.site,
            axis=entry.axis,
            accepted=entry.accepted,
            reason=entry.reason,
            parameters={n: (p.value, p.sigma) for n, p in entry.parameters.items()},
        )
        if estimate.accepted:
            self._first_update.setdefault(event.axis, self._moves)


def _put_aside(folder: Path) -> None:
    """Files of an earlier run go to `previous/`, so that they are not taken for this one's."""
    old = [folder / name for name in OUTPUTS if (folder / name).exists()]
    if old:
        aside = folder / "previous"
        aside.mkdir(exist_ok=True)
        for path in old:
            path.replace(aside / path.name)


def _pair(position: tuple[float, ...]) -> tuple[float, float]:
    return position[0], position[1]


def _empty(machine: Machine, request: RunRequest) -> Recording:
    """A recording without samples, for the summary of a run that never moved."""
    import numpy as np

    from sim2real.recording import AxisSignals

    none = np.zeros(0)
    return Recording(
        machine.text,
        request.recipe.text,
        request.started.isoformat(),
        none,
        {
            name: AxisSignals(none, none, none, none, None, np.zeros(0, dtype=np.bool_))
            for name in machine.axes
        },
        (),
        "",
    )
