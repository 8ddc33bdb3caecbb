"""The thread that owns bus and stage: it does one job at a time, and holds the axes meanwhile.

Idle, enabled axes are held by setpoints with every SYNC, for `hold_limit` at most; then they are
disabled. Idle without power, positions are still sampled. Neither observer nor journal are at work
then: both belong to runs.
"""

from __future__ import annotations

import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from queue import Empty, SimpleQueue

import numpy as np

from drivers.cyclic import RealTime
from drivers.errors import BusError, DriverError
from drivers.settings import AxisSettings, BusSettings
from drivers.stage import Stage
from hil_sim.bus import PacedWorld
from stagectl.config.machine import Machine
from stagectl.errors import Aborted, StagectlError, drivers_failures
from stagectl.protocol.state import Doing
from stagectl.server.handover import Handover, JobEnded, Phase, Said, fault_of

_HOLD = 0.25
"""Setpoints of an idle hold are sent for this long at a time, where nothing is asked for [s]."""
_WATCH = 0.05
"""The same without power [s]."""
_BUS_AWAY = 0.5
"""Between two attempts on a bus that fails [s]."""


@dataclass(frozen=True, slots=True)
class Work:
    """A job for the stage.

    Attributes:
        job: its number.
        doing: what the stage does meanwhile.
        what: the same in words.
        run: does it; what it returns is the job's result.
        alone: does it instead on the bus, where the stage must not be open; it is booted again
            afterwards.
    """

    job: int
    doing: Doing
    what: str
    run: Callable[[Stage], object] | None
    alone: Callable[[BusSettings], object] | None = None


@dataclass(frozen=True, slots=True)
class Simulated:
    """A virtual stage to keep, paced by the wall clock.

    Attributes:
        truth: the stage as it is.
        seed: of its noise.
    """

    truth: Machine
    seed: int


class StageKeeper(threading.Thread):
    """Owns the stage.

    Args:
        bus, axes: settings of the drivers.
        simulated: the virtual stage to make; None for drives on the bus.
        handover: what happens goes there.
        hold_limit: how long axes are held while there is nothing to do [s].

    Attributes:
        stage: once it is booted, until the end.
        world: of the virtual stage, or None.
        doing, what: the present state, in a word and in words.
        failure: why there is no stage, once the thread has ended for that.
        ready: set once the drives are booted, or cannot be.
    """

    def __init__(
        self,
        bus: BusSettings,
        axes: tuple[AxisSettings, ...],
        simulated: Simulated | None,
        handover: Handover,
        hold_limit: float,
    ) -> None:
        super().__init__(name="stage", daemon=True)
        self._bus, self._axes, self._simulated = bus, axes, simulated
        self._handover, self._hold_limit = handover, hold_limit
        self._inbox: SimpleQueue[Work] = SimpleQueue()
        self._ending = threading.Event()
        self._idle_since = time.monotonic()
        self._faulted = False
        self._alone: Work | None = None
        self._ended: JobEnded | None = None
        self.stage: Stage | None = None
        self.world: PacedWorld | None = None
        self.doing: Doing = "starting"
        self.what = "starting"
        self.failure: StagectlError | None = None
        self.ready = threading.Event()

    # -- from other threads -------------------------------------------------------------------

    def submit(self, work: Work) -> None:
        """Have something done; what becomes of it is handed over as `JobEnded`."""
        self._inbox.put(work)

    def stop(self, reason: str) -> None:
        """Stop what is under way, and what has been submitted but not begun."""
        with suppress(Empty):
            while True:
                work = self._inbox.get_nowait()
                self._handover.give(JobEnded(work.job, None, Aborted(reason)))
        self._handover.stop.press(reason)

    def end(self) -> None:
        """Disable the axes, close the bus and end the thread."""
        self._ending.set()
        if self.stage is None:
            self._handover.stop.press("the server ends")  # what has the bus alone

    @property
    def hold_left(self) -> float | None:
        """How long idle axes will still be held [s]; None where none are."""
        if self.doing != "held":
            return None
        return max(0.0, self._hold_limit - (time.monotonic() - self._idle_since))

    # -- the thread ---------------------------------------------------------------------------

    def run(self) -> None:
        """Keep the stage until `end`."""
        try:
            with drivers_failures(), self._on_bus() as bus:
                while not self._ending.is_set():
                    self._keep(bus)
                    if self._alone is not None:
                        self._do_alone(self._alone, bus)
        except StagectlError as error:
            self.failure = error
        except BaseException as error:  # noqa: BLE001  shown, whatever it is
            traceback.print_exc(file=sys.stderr)
            self.failure = StagectlError(f"internal error: {type(error).__name__}: {error}")
        finally:
            self.stage = None
            self.doing, self.what = "off", "the stage is switched off"
            self.ready.set()

    def _keep(self, bus: BusSettings) -> None:
        """Keep the stage until the end, or until something needs the bus alone."""
        with Stage.open(bus, self._axes) as stage:
            stage.own_bus()
            stage.sink = self._handover.sample
            stage.tap, self._handover.send = self._handover.frame, stage.send_frame
            self.doing, self.what = "booting", "booting the drives"
            stage.boot()
            stage.interrupt, self._faulted = self._handover.look, False
            for text in (*stage.limitations, *stage.notices):
                self._handover.give(Said(text))
            self.stage = stage
            self._rest(stage)
            self.ready.set()
            if self._ended is not None:
                self._handover.give(self._ended)
                self._ended = None
            while not self._ending.is_set() and self._alone is None:
                self._turn(stage)
            self.stage = None

    def _do_alone(self, work: Work, bus: BusSettings) -> None:
        """What needs the bus alone; then the stage is to be booted again."""
        assert work.alone is not None  # noqa: S101  see `_turn`
        self._alone, result, error = None, None, None
        try:
            with drivers_failures():
                stopped = self._handover.stop.was_heeded()  # while the stage was closed
                if stopped is not None:
                    raise Aborted(stopped)
                result = work.alone(bus)
        except BaseException as why:  # noqa: BLE001  becomes the job's
            error = why
            if not isinstance(why, StagectlError):
                traceback.print_exc(file=sys.stderr)
        self._handover.stop.was_heeded()
        self._idle_since = time.monotonic()
        self._ended = JobEnded(work.job, result, error)

    @contextmanager
    def _on_bus(self) -> Iterator[BusSettings]:
        if self._simulated is None:
            yield self._bus
            return
        from hil_sim.plant import warm_up
        from hil_sim.stage import VirtualStage
        from stagectl.config import stage_settings

        settings = stage_settings(self._simulated.truth)
        warm_up(settings)
        world = self.world = PacedWorld(f"server-{id(self)}")
        VirtualStage(settings, self._simulated.seed).attach(world)
        world.sleep_until_ns(100_000_000)  # the drives boot up
        real_time = RealTime(self._bus.realtime)  # as on a real bus: it keeps to the wall clock
        real_time.begin()
        for clause in real_time.refused:
            self._handover.give(Said(clause))
        try:
            yield replace(self._bus, interface="lockstep", channel=world.name)
        finally:
            real_time.end()

    def _turn(self, stage: Stage) -> None:
        try:
            work = self._inbox.get_nowait()
        except Empty:
            self._idle(stage)
            return
        self.doing, self.what = work.doing, work.what
        if work.run is None:
            self._alone = work
            return
        error: BaseException | None = None
        result = None
        try:
            with drivers_failures():
                self._handover.stop.check()
                result = work.run(stage)
            self._faulted = False
        except BaseException as why:  # noqa: BLE001  becomes the job's
            error = why
            self._take_failure(stage, why)
        if self._handover.stop.was_heeded() is not None and stage.enabled:
            stage.safe_stop()  # the button was seen between two motions
        self._idle_since = time.monotonic()
        self._rest(stage)
        self._handover.give(JobEnded(work.job, result, error))

    def _take_failure(self, stage: Stage, error: BaseException) -> None:
        """What a failure leaves: a stage at rest, and an alarm where something is wrong with it."""
        if not isinstance(error, StagectlError):
            traceback.print_exc(file=sys.stderr)
            stage.safe_stop()
        fault = fault_of(error)
        if fault is not None:
            self._faulted = True
            self._handover.give(fault)

    def _idle(self, stage: Stage) -> None:
        """Hold what is enabled, sample what is not."""
        try:
            self._handover.stop.check()
            if stage.enabled:
                if time.monotonic() - self._idle_since >= self._hold_limit:
                    stage.disable()
                    self._handover.give(
                        Said(f"axes disabled: nothing to do for {self._hold_limit:g} s")
                    )
                else:
                    self._hold(stage)
            else:
                stage.watch(_WATCH, checked=not self._faulted)
        except Aborted as stopped:
            self._handover.stop.was_heeded()  # here, and not in the next job
            stage.safe_stop()
            self._handover.give(Said(str(stopped)))
        except DriverError as error:
            fault = fault_of(error)
            if fault is not None and not self._faulted:
                self._handover.give(fault)
            self._faulted = True
            if isinstance(error, BusError):
                time.sleep(_BUS_AWAY)
        self._rest(stage)

    def _hold(self, stage: Stage) -> None:
        """Hold the axes until there is something to do, for a moment at most."""
        inbox, ending = self._inbox, self._ending
        rows = max(1, round(_HOLD / stage.settings.sync_period))
        targets, offsets = np.array(stage.targets), np.array(stage.offsets)
        stage.stream(
            np.tile(targets, (rows, 1)),
            np.tile(offsets, (rows, 1)),
            lambda _: not inbox.empty() or ending.is_set(),
        )

    def _rest(self, stage: Stage) -> None:
        """The state between jobs, in words."""
        if self._faulted:
            self.doing, self.what = "fault", "stopped by a fault; enable or home with reset"
        elif stage.enabled:
            self.doing, self.what = "held", "axes enabled and held"
        else:
            self.doing, self.what = "disabled", "axes without power"

    def phase(self, text: str) -> None:
        """A phase of the present job begins."""
        self.what = text
        self._handover.give(Phase(text))
