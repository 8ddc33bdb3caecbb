"""What a server knows and guards: jobs, command, alarms, the queue, the run; used by one thread."""

from __future__ import annotations

import hashlib
import os
import sys
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from typing import Any

from drivers.errors import DriverError
from drivers.settings import AxisSettings, BusSettings
from drivers.stage import Stage
from stagectl.errors import StagectlError
from stagectl.protocol.message import VERSION
from stagectl.protocol.state import AxisInfo, Doing, Job, Notice, Refusal, ServerInfo, State
from stagectl.run import software_version
from stagectl.server.command_lease import CommandLease
from stagectl.server.handover import Fault, Handover, Happened, Item, JobEnded, Phase, Said
from stagectl.server.jobs import Jobs
from stagectl.server.keeper import StageKeeper, Work
from stagectl.server.motions import JogDemand, Motions
from stagectl.server.notices import Alarms, Notices, in_words
from stagectl.server.run_queue import RunQueue
from stagectl.server.running import Active, Runner
from stagectl.server.setup import Setup
from stagectl.server.snapshot import BusLoad, DriveSignals, Sampling

_LAST = 30.0
"""Longest wait for a run's files when the server ends [s]."""

Reply = Callable[[Any], None]
"""Called once with the result of a request: plain values, a message, or a `Refusal`."""
Later = Callable[[Reply], object]
"""The result of a request that is answered later: it is given what to answer with."""


class RefusedError(Exception):
    """A request that is refused."""

    def __init__(self, kind: Any, text: str) -> None:
        super().__init__(text)
        self.refusal = Refusal(kind=kind, text=text)


class Service:
    """The state of a server, which `handlers` answer requests from.

    Args:
        setup: what is served.
        keeper: of the stage, started by the caller.
        handover: what the keeper's thread hands over.
        publish: called with each notice.

    Raises:
        UnusableInput: the queue on disk is damaged.
    """

    def __init__(
        self,
        setup: Setup,
        keeper: StageKeeper,
        handover: Handover,
        publish: Callable[[Notice], object],
    ) -> None:
        self.setup, self.keeper, self.handover = setup, keeper, handover
        self.notices = Notices(publish)
        self.jobs, self.lease, self.alarms = Jobs(), CommandLease(), Alarms()
        self.queue = RunQueue(setup.data)
        self.runner = Runner(setup, self.queue, handover, self._begin_run, self.notices.say)
        self.runner.recover()
        self.motions = Motions(setup.machine, keeper.phase)
        self.job: Job | None = None
        self._run_job: int | None = None
        self.jog: tuple[Job, str, JogDemand] | None = None
        self._started = datetime.now(UTC).astimezone().isoformat(timespec="seconds")
        self._pool = ThreadPoolExecutor(1, "objects")
        control = next(iter(setup.machine.axes.values())).drive.control_period
        self.sampling = Sampling(control / setup.bus.sync_period)
        self._signals, self._load = DriveSignals(), BusLoad(setup.bus.bitrate)

    # -- what comes from the stage --------------------------------------------------------------

    def turn(self) -> bool:
        """Take what the stage's thread has handed over; whether anything has changed."""
        items, changed = self.handover.items, bool(self.handover.items)
        while items:
            try:
                self._take(items.popleft())
            except Exception:  # noqa: BLE001  the stage must not suffer from it
                traceback.print_exc(file=sys.stderr)
        before = self.runner.active
        self.runner.turn(free=self.job is None)
        self.jobs.answer()
        self._signals.turn(self.keeper.stage)
        return changed or before is not self.runner.active

    def _take(self, item: Item) -> None:
        match item:
            case Happened(event=event, time=when):
                self.runner.take(event, when)
                kind, text, data = in_words(event)
                self.notices.say(kind, text, data, when)
            case Phase(text=text):
                self.notices.say("phase", text)
            case Said(text=text):
                self.notices.say("limitation", text)
            case Fault():
                alarm = self.alarms.take(item)
                about = {"id": alarm.id, "axis": alarm.axis}
                self.notices.say("alarm", alarm.text, about, alarm.time)
            case JobEnded(job=number, result=result, error=error):
                self._end_job(number, result, error)

    def _end_job(self, number: int, result: object, error: BaseException | None) -> None:
        self.jobs.end(number, result, error)
        if self.job is not None and self.job.id == number:
            self.job = None
        if number == self._run_job:
            self._run_job = None
            self.runner.operated(error)
        elif error is not None:
            self.notices.say("job", f"failed: {' '.join(str(error).split())}", {"id": number})

    def _begin_run(self, what: str, run: Callable[[Stage], object]) -> None:
        self._run_job = self._submit("running", what, run).id

    def begin(
        self, doing: Doing, what: str, run: Callable[[Stage], object] | None = None,
        alone: Callable[[BusSettings], object] | None = None,
    ) -> Job:  # fmt: skip
        """Have the stage do something, on the booted stage or with the bus alone.

        Raises:
            RefusedError: there is no stage, or it is busy.
        """
        self.require_free()
        return self._submit(doing, what, run, alone)

    def _submit(
        self, doing: Doing, what: str, run: Callable[[Stage], object] | None,
        alone: Callable[[BusSettings], object] | None = None,
    ) -> Job:  # fmt: skip
        job = self.job = self.jobs.begin(what)
        self.keeper.submit(Work(job.id, doing, what, run, alone))
        return job

    def later(self, work: Callable[[], Any]) -> Later:
        """Answer from another thread, where what is asked for takes a while."""

        def answer(reply: Reply) -> None:
            try:
                reply(work())
            except (DriverError, StagectlError, ValueError) as why:
                reply(Refusal(kind="input", text=" ".join(str(why).split())))

        return lambda reply: self._pool.submit(answer, reply)

    def end(self) -> None:
        """The server ends: a run is stopped; its files, and those of earlier ones, are made."""
        self.runner.abort("the server was stopped")
        deadline = time.monotonic() + _LAST
        while self.runner.is_busy and time.monotonic() < deadline:
            self.turn()
            time.sleep(0.02)
        self._pool.shutdown(wait=False)
        self._signals.close()

    # -- what clients see -----------------------------------------------------------------------

    def info(self) -> ServerInfo:
        """Who serves."""
        setup, machine = self.setup, self.setup.machine
        return ServerInfo(
            version=VERSION,
            program=software_version(),
            machine=machine.name,
            machine_file=str(setup.machine_file or "wafer-xy"),
            machine_digest=hashlib.sha256(machine.text.encode()).hexdigest(),
            bus="simulated" if setup.simulated else f"{setup.bus.interface}:{setup.bus.channel}",
            simulated=setup.simulated is not None,
            pid=os.getpid(),
            started=self._started,
            period=setup.bus.sync_period,
            control_period=next(iter(machine.axes.values())).drive.control_period,
            hold_limit=setup.hold_limit,
            pause_limit=setup.pause_limit,
            data=str(setup.data.absolute()),
            axes=tuple(
                AxisInfo(
                    name=axis.name, node=axis.node, travel=axis.travel, velocity=axis.velocity,
                    acceleration=axis.acceleration,
                )
                for axis in setup.axes
            ),
        )  # fmt: skip

    def state(self) -> State:
        """The present state."""
        keeper, stage, active = self.keeper, self.keeper.stage, self.runner.active
        run = None if active is None else active.state()
        paused = run is not None and run.paused_since is not None
        return State(
            version=VERSION,
            time=time.time(),
            doing="paused" if paused and keeper.doing == "running" else keeper.doing,
            what=keeper.what,
            axes=() if stage is None else self.sampling.axes(stage, self._signals),
            enabled=stage is not None and stage.enabled,
            homed=stage is not None and stage.homed,
            hold_left=keeper.hold_left,
            run=run,
            job=self.job,
            queue=self.queue.entries,
            queue_runs=self.queue.runs,
            lease=self.lease.held,
            alarms=self.alarms.open,
            late=(0 if stage is None else stage.late)
            + (0 if keeper.world is None else keeper.world.late),
            missed=0 if stage is None else stage.missed,
            bus_load=self._load.of(self.handover.bits),
            event=self.notices.number,
        )

    # -- what must hold --------------------------------------------------------------------------

    def require_command(self, token: str | None) -> None:
        """Refuse a client that does not command while another one does; its command is renewed."""
        held = None if self.lease.renew(token) else self.lease.held
        if held is not None:
            raise RefusedError("not_in_command", f"{held.holder} commands the stage")

    def require_stage(self) -> Stage:
        """The stage, where there is one."""
        if self.keeper.stage is None:
            raise RefusedError("unavailable", f"no stage: {self.keeper.what}")
        return self.keeper.stage

    def require_free(self) -> None:
        """Refuse while a run or anything else is under way."""
        self.require_stage()
        active = self.runner.active
        if active is not None and active.stage != "finishing":
            raise RefusedError("busy", f"busy: {active.stage} {active.stored.entry.recipe}")
        if self.job is not None:
            raise RefusedError("busy", f"busy: {self.keeper.what}")

    def require_run(self) -> Active:
        """The run under way."""
        active = self.runner.active
        if active is None or active.stage == "finishing":
            raise RefusedError("unavailable", "no run is under way")
        return active

    def axis(self, name: str) -> AxisSettings:
        """An axis by its name."""
        for axis in self.setup.axes:
            if axis.name == name:
                return axis
        names = ", ".join(axis.name for axis in self.setup.axes)
        raise RefusedError("unknown", f"no axis {name!r}; there are {names}")
