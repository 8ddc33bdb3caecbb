"""What clients may ask for, and when; the state that they see. Used by one thread."""

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
from drivers.objects import ObjectRef
from drivers.settings import BusSettings
from stagectl.errors import ConfigError, StagectlError
from stagectl.protocol import requests as ask
from stagectl.protocol.message import VERSION, Message
from stagectl.protocol.state import (
    AxisInfo,
    Doing,
    Job,
    Notice,
    Refusal,
    ServerInfo,
    State,
)
from stagectl.recipe import dry_run, parse_recipe
from stagectl.run import software_version
from stagectl.server.alarms import Alarms
from stagectl.server.believed import setup_for
from stagectl.server.command_lease import CommandLease
from stagectl.server.commissioning import check_drive, check_move, measure
from stagectl.server.drive_signals import DriveSignals
from stagectl.server.handover import (
    Fault,
    Handover,
    Happened,
    Item,
    JobEnded,
    Phase,
    Said,
)
from stagectl.server.jobs import Jobs
from stagectl.server.keeper import StageKeeper, Work
from stagectl.server.motions import JOG_MOST, JogDemand, Motions, checked_velocity
from stagectl.server.notices import Notices, in_words
from stagectl.server.run_queue import RunQueue
from stagectl.server.running import Runner, asked_recipe
from stagectl.server.setup import Setup
from stagectl.server.snapshot import BusLoad, Sampling

Reply = Callable[[Any], None]
"""Called once with the result of a request: plain values, a message, or a `Refusal`."""


class RefusedError(Exception):
    """A request that is refused."""

    def __init__(self, kind: Any, text: str, problems: tuple[str, ...] = ()) -> None:
        super().__init__(text)
        self.refusal = Refusal(kind=kind, text=text, problems=problems)


class Service:
    """A server's answers.

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
        self._setup, self._keeper, self._handover = setup, keeper, handover
        self._notices = Notices(publish)
        self._jobs, self._lease, self._alarms = Jobs(), CommandLease(), Alarms()
        self.queue = RunQueue(setup.data)
        self._runner = Runner(setup, self.queue, handover, self._begin_run, self._notices.say)
        self._runner.recover()
        self._motions = Motions(setup.machine, keeper.phase)
        self._job: Job | None = None
        self._run_job: int | None = None
        self._jog: tuple[Job, str, JogDemand] | None = None
        self._started = datetime.now(UTC).astimezone().isoformat(timespec="seconds")
        self._pool = ThreadPoolExecutor(1, "objects")
        self._handlers: dict[type[Message], Callable[..., Any]] = {
            ask.Info: self._info, ask.GetState: self._state, ask.GetEvents: self._events,
            ask.Take: self._take_lease, ask.Release: self._release, ask.Stop: self._stop,
            ask.Wait: self._wait, ask.Enable: self._enable, ask.Disable: self._disable,
            ask.Home: self._home, ask.Measure: self._measure, ask.Check: self._check,
            ask.Move: self._move, ask.Jog: self._jog_axis,
            ask.CheckRecipe: self._check_recipe, ask.QueueAdd: self._queue_add,
            ask.QueueRemove: self._queue_remove, ask.QueueReorder: self._queue_reorder,
            ask.QueueStart: self._queue_start, ask.QueueHalt: self._queue_halt,
            ask.Pause: self._pause, ask.Resume: self._resume, ask.Abort: self._abort,
            ask.ReadObject: self._read_object, ask.WriteObject: self._write_object,
            ask.Listen: self._listen, ask.SendFrame: self._send_frame,
            ask.Acknowledge: self._acknowledge,
        }  # fmt: skip
        control = next(iter(setup.machine.axes.values())).drive.control_period
        self.sampling = Sampling(control / setup.bus.sync_period)
        self._signals, self._load = DriveSignals(), BusLoad(setup.bus.bitrate)

    # -- what comes from the stage --------------------------------------------------------------

    def turn(self) -> bool:
        """Take what the stage's thread has handed over; whether anything has changed."""
        items, changed = self._handover.items, bool(self._handover.items)
        while items:
            try:
                self._take(items.popleft())
            except Exception:  # noqa: BLE001  the stage must not suffer from it
                traceback.print_exc(file=sys.stderr)
        before = self._runner.active
        self._runner.turn(free=self._job is None)
        self._jobs.answer()
        self._signals.turn(self._keeper.stage)
        return changed or before is not self._runner.active

    def _take(self, item: Item) -> None:
        match item:
            case Happened(event=event, time=when):
                self._runner.take(event, when)
                kind, text, data = in_words(event)
                self._notices.say(kind, text, data, when)
            case Phase(text=text):
                self._notices.say("phase", text)
            case Said(text=text):
                self._notices.say("limitation", text)
            case Fault():
                alarm = self._alarms.take(item)
                about = {"id": alarm.id, "axis": alarm.axis}
                self._notices.say("alarm", alarm.text, about, alarm.time)
            case JobEnded(job=number, result=result, error=error):
                self._end_job(number, result, error)

    def _end_job(self, number: int, result: object, error: BaseException | None) -> None:
        self._jobs.end(number, result, error)
        if self._job is not None and self._job.id == number:
            self._job = None
        if number == self._run_job:
            self._run_job = None
            self._runner.operated(error)
        elif error is not None:
            self._notices.say("job", f"failed: {' '.join(str(error).split())}", {"id": number})

    def _begin_run(self, what: str, run: Callable[..., object]) -> None:
        self._run_job = self._begin("running", what, run).id

    def _begin(
        self, doing: Doing, what: str, run: Callable[..., object] | None = None,
        alone: Callable[[BusSettings], object] | None = None,
    ) -> Job:  # fmt: skip
        job = self._job = self._jobs.begin(what)
        self._keeper.submit(Work(job.id, doing, what, run, alone))
        return job

    def end(self) -> None:
        """The server ends: a run is stopped; its files, and those of earlier ones, are made."""
        self._runner.abort("the server was stopped")
        deadline = time.monotonic() + _LAST
        while self._runner.is_busy and time.monotonic() < deadline:
            self.turn()
            time.sleep(0.02)
        self._pool.shutdown(wait=False)
        self._signals.close()

    # -- what clients see -----------------------------------------------------------------------

    def info(self) -> ServerInfo:
        """Who serves."""
        setup, machine = self._setup, self._setup.machine
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
        keeper, stage, active = self._keeper, self._keeper.stage, self._runner.active
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
            job=self._job,
            queue=self.queue.entries,
            queue_runs=self.queue.runs,
            lease=self._lease.held,
            alarms=self._alarms.open,
            late=(0 if stage is None else stage.late)
            + (0 if keeper.world is None else keeper.world.late),
            missed=0 if stage is None else stage.missed,
            bus_load=self._load.of(self._handover.bits),
            event=self._notices.number,
        )

    # -- what clients ask for -------------------------------------------------------------------

    def handle(self, request: ask.Request, reply: Reply) -> None:
        """Answer a request, now or later."""
        command = request.command
        try:
            commands = self._lease.renew(request.lease)
            held = self._lease.held
            if held is not None and not commands and not isinstance(command, ask.FREE):
                raise RefusedError("not_in_command", f"{held.holder} commands the stage")
            result = self._handlers[type(command)](command, request, reply)
        except RefusedError as why:
            result = why.refusal
        except ConfigError as why:
            result = Refusal(kind="input", text=why.problems[0], problems=why.problems)
        except StagectlError as why:
            result = Refusal(kind="input", text=" ".join(str(why).split()))
        except Exception as why:  # noqa: BLE001  the stage must not suffer from it
            traceback.print_exc(file=sys.stderr)
            result = Refusal(kind="internal", text=f"internal error: {type(why).__name__}: {why}")
        if result is not LATER:
            reply(result)

    def _info(self, *_: object) -> ServerInfo:
        return self.info()

    def _state(self, *_: object) -> State:
        return self.state()

    def _events(self, command: ask.GetEvents, *_: object) -> list[Notice]:
        return self._notices.since(command.since)

    def _take_lease(self, command: ask.Take, request: ask.Request, *_: object) -> dict[str, str]:
        held = self._lease.held
        if held is not None and not command.force and not self._lease.renew(request.lease):
            raise RefusedError("not_in_command", f"{held.holder} commands the stage")
        self._notices.say(
            "lease", f"{request.client} commands the stage", {"holder": request.client}
        )
        return {"lease": self._lease.take(request.client)}

    def _release(self, _: object, request: ask.Request, *__: object) -> dict[str, bool]:
        released = self._lease.release(request.lease)
        if released:
            self._notices.say("lease", "nobody commands the stage", {"holder": None})
        return {"released": released}

    def _stop(self, command: ask.Stop, request: ask.Request, *_: object) -> dict[str, bool]:
        reason = f"stopped by {request.client}" + (f": {command.reason}" if command.reason else "")
        self._handover.stop.press(reason)
        self._runner.abort(reason)
        self._notices.say("stopping", reason)
        return {"pressed": True}

    def _wait(self, command: ask.Wait, _: object, reply: Reply) -> object:
        if self._jobs.find(command.job) is None:
            raise RefusedError("unknown", f"there is no job {command.job}")
        self._jobs.wait(command.job, command.timeout, reply)
        return LATER

    def _enable(self, command: ask.Enable, *_: object) -> Job:
        self._require_free()
        return self._begin(
            "enabling", "enabling", lambda stage: self._motions.enable(stage, command.reset)
        )

    def _disable(self, *_: object) -> Job:
        self._require_free()
        return self._begin("stopping", "disabling", self._motions.disable)

    def _home(self, command: ask.Home, *_: object) -> Job:
        self._require_free()
        return self._begin(
            "homing", "homing",
            lambda stage: self._motions.home(stage, command.force, command.reset),
        )  # fmt: skip

    def _measure(self, command: ask.Measure, *_: object) -> Job:
        self._require_free()
        machine, simulated = self._setup.machine, self._setup.simulated is not None
        return self._begin(
            "moving", "measuring the axes",
            lambda stage: measure(stage, machine, simulated, command.agreed),
        )  # fmt: skip

    def _check(self, command: ask.Check, *_: object) -> Job:
        setup, handover = self._setup, self._handover
        axis = next((each for each in setup.axes if each.node == command.node), None)
        if command.move and axis is None:
            raise RefusedError("unknown", f"no axis has node id {command.node}")
        self._require_free()
        if command.move and axis is not None:
            moved = axis
            return self._begin(
                "moving", f"checking axis {axis.name} by a move",
                alone=lambda bus: check_move(bus, handover, moved, setup.machine),
            )  # fmt: skip
        return self._begin(
            "moving", f"checking node {command.node}",
            alone=lambda bus: check_drive(
                bus, handover, command.node, command.power, command.homing
            ),
        )  # fmt: skip

    def _move(self, command: ask.Move, *_: object) -> Job:
        axis = self._axis(command.axis)
        velocity = checked_velocity(command.velocity, axis.velocity, axis.name)
        self._require_free()
        return self._begin(
            "moving", f"moving {axis.name}",
            lambda stage: self._motions.move(
                stage, axis.name, command.position, command.distance or 0.0, velocity
            ),
        )  # fmt: skip

    def _jog_axis(self, command: ask.Jog, *_: object) -> Job:
        axis = self._axis(command.axis)
        if abs(command.velocity) > min(JOG_MOST, axis.velocity):
            most = min(JOG_MOST, axis.velocity)
            raise RefusedError("input", f"axis {axis.name}: a jog has at most {most:g} m/s")
        if self._jog is not None:
            job, jogged, demand = self._jog
            if self._job is not None and self._job.id == job.id and jogged == axis.name:
                demand.velocity, demand.renewed = command.velocity, time.monotonic()
                return job
        self._require_free()
        demand = JogDemand(command.velocity, time.monotonic())
        job = self._begin(
            "moving", f"jogging {axis.name}",
            lambda stage: self._motions.jog(stage, axis.name, demand),
        )  # fmt: skip
        self._jog = job, axis.name, demand
        return job

    def _check_recipe(self, command: ask.CheckRecipe, _: object, reply: Reply) -> object:
        recipe = parse_recipe(command.recipe, command.source, self._setup.machine)
        self._later(lambda: dry_run(recipe, self._setup.machine).as_dict(), reply)
        return LATER

    def _queue_add(self, command: ask.QueueAdd, *_: object) -> dict[str, int]:
        recipe = asked_recipe(command, setup_for(self._setup, command).machine)
        if command.options.compensation == "oracle" and self._setup.simulated is None:
            raise RefusedError("input", "oracle: a real stage's friction is unknown")
        entry = self.queue.add(command, recipe.name, recipe.lot, recipe.wafer)
        self._notices.say("queue", f"{recipe.name}: in the queue", {"id": entry.id})
        if command.start:
            self.queue.runs = True
        return {"id": entry.id}

    def _queue_remove(self, command: ask.QueueRemove, *_: object) -> dict[str, bool]:
        entry = self.queue.find(command.id)
        if entry is None:
            raise RefusedError("unknown", f"the queue has no entry {command.id}")
        if entry.status in ("running", "finishing"):
            raise RefusedError("busy", f"entry {command.id} is running; abort it first")
        self.queue.remove(command.id)
        return {"removed": True}

    def _queue_reorder(self, command: ask.QueueReorder, *_: object) -> dict[str, bool]:
        entry = self.queue.find(command.id)
        if entry is None or entry.status != "waiting":
            raise RefusedError("unknown", f"no entry {command.id} waits in the queue")
        self.queue.reorder(command.id, command.place)
        return {"moved": True}

    def _queue_start(self, *_: object) -> dict[str, bool]:
        self.queue.runs = self.queue.next() is not None
        return {"runs": self.queue.runs}

    def _queue_halt(self, *_: object) -> dict[str, bool]:
        self.queue.runs = False
        return {"runs": False}

    def _pause(self, *_: object) -> dict[str, bool]:
        self._require_run().pause.ask()
        return {"asked": True}

    def _resume(self, *_: object) -> dict[str, bool]:
        self._require_run().pause.withdraw()
        return {"asked": True}

    def _abort(self, command: ask.Abort, request: ask.Request, *_: object) -> dict[str, bool]:
        self._require_run()
        reason = f"stopped by {request.client}" + (f": {command.reason}" if command.reason else "")
        self._runner.abort(reason)
        return {"asked": True}

    def _read_object(self, command: ask.ReadObject, _: object, reply: Reply) -> object:
        node = self._node(command.axis)
        ref = ObjectRef(command.index, command.subindex, "object")
        self._later(lambda: {"value": node.read_value(ref)}, reply)
        return LATER

    def _write_object(self, command: ask.WriteObject, _: object, reply: Reply) -> object:
        self._require_free()
        node = self._node(command.axis)
        ref = ObjectRef(command.index, command.subindex, "object")

        def write() -> dict[str, bool]:
            node.write(ref, command.value)
            return {"written": True}

        self._later(write, reply)
        return LATER

    def _listen(self, *_: object) -> dict[str, float]:
        self._handover.listened_until = time.monotonic() + LISTENED
        return {"for": LISTENED}

    def _send_frame(
        self, command: ask.SendFrame, request: ask.Request, *_: object
    ) -> dict[str, bool]:
        if command.data[0] >> 5 not in _READS:
            held = self._lease.held
            if held is not None and not self._lease.renew(request.lease):
                raise RefusedError("not_in_command", f"{held.holder} commands the stage")
            self._require_free()
        if self._keeper.stage is None:
            raise RefusedError("unavailable", f"no stage: {self._keeper.what}")
        self._handover.outgoing.append((command.can_id, command.data))
        return {"sent": True}

    def _acknowledge(
        self, command: ask.Acknowledge, request: ask.Request, *_: object
    ) -> dict[str, bool]:
        alarm = self._alarms.acknowledge(command.alarm, request.client)
        if alarm is None:
            raise RefusedError("unknown", f"there is no open alarm {command.alarm}")
        self._notices.say(
            "alarm", f"acknowledged by {request.client}: {alarm.text}", {"id": alarm.id}
        )
        return {"acknowledged": True}

    # -- what must hold --------------------------------------------------------------------------

    def _require_free(self) -> None:
        if self._keeper.stage is None:
            raise RefusedError("unavailable", f"no stage: {self._keeper.what}")
        active = self._runner.active
        if active is not None and active.stage != "finishing":
            raise RefusedError("busy", f"busy: {active.stage} {active.entry.recipe}")
        if self._job is not None:
            raise RefusedError("busy", f"busy: {self._keeper.what}")

    def _require_run(self) -> Any:
        active = self._runner.active
        if active is None or active.stage == "finishing":
            raise RefusedError("unavailable", "no run is under way")
        return active

    def _axis(self, name: str) -> AxisInfo:
        for axis in self.info().axes:
            if axis.name == name:
                return axis
        names = ", ".join(axis.name for axis in self._setup.axes)
        raise RefusedError("unknown", f"no axis {name!r}; there are {names}")

    def _node(self, name: str) -> Any:
        self._axis(name)
        if self._keeper.stage is None:
            raise RefusedError("unavailable", f"no stage: {self._keeper.what}")
        return next(axis.node for axis in self._keeper.stage.axes if axis.name == name)

    def _later(self, work: Callable[[], Any], reply: Reply) -> None:
        """Answer from another thread, where what is asked for takes a while."""

        def run() -> None:
            try:
                reply(work())
            except (DriverError, StagectlError, ValueError) as why:
                reply(Refusal(kind="input", text=" ".join(str(why).split())))

        self._pool.submit(run)


_LAST = 30.0
"""Longest wait for a run's files when the server ends [s]."""
LISTENED = 10.0
"""How long frames are published after a request for them [s]."""
_READS = (2, 3, 4, 5)
"""Client command specifiers of SDO that write nothing: upload, its segments and blocks, abort."""
LATER = object()
"""A handler's result where the answer comes later."""


def plain(result: Any) -> Any:
    """A result as plain values for msgpack."""
    if isinstance(result, Message):
        return result.model_dump(mode="python")
    if isinstance(result, list):
        return [plain(each) for each in result]
    return result
