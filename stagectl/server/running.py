"""A run from its entry in the queue to its files.

What takes long happens outside the stage's thread: checking and preparing before the run, in a
thread; the files after it, in a process of low priority (`stagectl recover`), so that nothing
delays the setpoints that hold the axes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from queue import Empty, SimpleQueue

from drivers.stage import Stage
from stagectl.config.machine import Machine
from stagectl.errors import Aborted, StagectlError
from stagectl.history import default_history
from stagectl.protocol.requests import QueueAdd
from stagectl.protocol.state import RunLimits, RunState
from stagectl.recipe import Recipe, count_segments, parse_recipe
from stagectl.recipe.plan import MoveStep, plan_from
from stagectl.run import (
    HostSettings,
    Listener,
    Remarks,
    RunRequest,
    SimulatedStage,
    find_measurement,
    load_interrupted,
)
from stagectl.run.access import HeldStage
from stagectl.run.execution import make_session
from stagectl.run.session import Session
from stagectl.sequencer import Event, Mode, PauseRequest, events
from stagectl.server.handover import Handover
from stagectl.server.run_queue import RunQueue, Stored
from stagectl.server.setup import Setup, setup_for


def asked_recipe(asked: QueueAdd, machine: Machine) -> Recipe:
    """The recipe of an entry, or the moves of its calibration.

    Raises:
        ConfigError: it cannot be run on this machine; one line per problem.
    """
    if asked.places is None:
        return parse_recipe(asked.recipe, asked.source, machine)
    from stagectl.calibration import parse_calibration

    measured = parse_calibration(asked.recipe, asked.source, machine).recipe
    return replace(measured, sites=asked.places)


def run_request(setup: Setup, asked: QueueAdd, recipe: Recipe, folder: Path) -> RunRequest:
    """The run that an entry of the queue asks for.

    Raises:
        ConfigError, UnusableInput: the run to continue cannot be used.
    """
    resume = None if asked.resume is None else load_interrupted(Path(asked.resume), recipe)
    options, simulated = asked.options, setup.simulated
    return RunRequest(
        recipe,
        setup.machine,
        folder,
        datetime.now(UTC).astimezone(),
        simulated=None if simulated is None else SimulatedStage(simulated.truth, simulated.seed),
        host=HostSettings(
            mode=Mode(options.compensation),
            friction_scale=options.friction_scale,
            use_map=options.use_map,
            observer=options.observer,
        ),
        remarks=Remarks(asked.operator, asked.comment).or_of(resume),
        bus=setup.named_bus,
        retries=options.retries,
        resumed=resume,
        history=default_history(
            options.history, setup.machine, simulated is not None, folder, asked.folder is not None
        ),
    )


@dataclass
class _Progress:
    """How far the run is."""

    recipe: Recipe
    done: int
    moves_of: int
    phase: str = "preparing"
    moves: int = 0
    site: int | None = None
    first: float | None = None
    paused_since: float | None = None

    @classmethod
    def of(cls, request: RunRequest) -> _Progress:
        done = 0 if request.resumed is None else request.resumed.done
        steps = plan_from(request.recipe, done)
        return cls(request.recipe, done, sum(isinstance(step, MoveStep) for step in steps))

    def take(self, event: Event, when: float) -> None:
        match event:
            case events.MoveStarted(site=site, kind=kind):
                self.first = when if self.first is None else self.first
                self.moves, self.site, self.phase = self.moves + 1, site, f"{kind}-move"
            case events.Waiting(reason=reason):
                self.phase = reason
            case events.SegmentDone(number=number):
                self.done = number
            case events.Paused():
                self.phase, self.paused_since = "paused", when
            case events.Continued():
                self.paused_since = None

    def left(self, now: float) -> float | None:
        """As long per move as so far [s]."""
        if self.first is None or self.moves < 2:
            return None
        return (now - self.first) / (self.moves - 1) * (self.moves_of - self.moves + 1)


@dataclass
class Active:
    """The run under way.

    Attributes:
        stored: its entry.
        stage: of it: `preparing`, `running`, `finishing`.
        folder: for its files.
        cancelled: why it is to end before it has begun, or None.
    """

    stored: Stored
    folder: Path
    pause: PauseRequest
    stage: str = "preparing"
    cancelled: str | None = None
    session: Session | None = None
    progress: _Progress | None = None
    stop: Callable[[str], None] | None = None
    error: StagectlError | None = None

    def state(self) -> RunState:
        """As published."""
        p, now = self.progress, time.time()
        return RunState(
            entry=self.stored.entry.id,
            recipe=self.stored.entry.recipe,
            folder=str(self.folder),
            phase=self.stage if p is None or self.stage != "running" else p.phase,
            sites=() if p is None else tuple(p.recipe.sites),
            site=None if p is None else p.site,
            done=0 if p is None else p.done,
            of=0 if p is None else count_segments(p.recipe),
            moves=0 if p is None else p.moves,
            moves_of=0 if p is None else p.moves_of,
            elapsed=None if p is None or p.first is None else now - p.first,
            left=None if p is None or self.stage != "running" else p.left(now),
            paused_since=None if p is None else p.paused_since,
            limits=None if p is None else _limits(p.recipe),
        )


def _limits(recipe: Recipe) -> RunLimits:
    limits, settle = recipe.limits, recipe.settle
    return RunLimits(
        settling=limits.settling, peak_error=limits.peak_error, window=settle.window,
        hold=settle.hold,
    )  # fmt: skip


@dataclass(slots=True)
class Runner:
    """Takes runs from the queue, one at a time; used by the thread that talks to clients.

    Attributes:
        active: the run under way, or None.
        begin: called with a function for the stage's thread; what it raises is an internal error.
        say: called with kind, text and figures of what happens.
    """

    setup: Setup
    queue: RunQueue
    handover: Handover
    begin: Callable[[str, Callable[[Stage], object]], object]
    say: Callable[..., object]
    active: Active | None = None
    _results: SimpleQueue[Callable[[], object]] = field(default_factory=SimpleQueue)
    _threads: list[threading.Thread] = field(default_factory=list)

    def turn(self, free: bool) -> None:
        """Take what has come from threads; begin with the next entry where the stage is free."""
        with suppress(Empty):
            while True:
                self._results.get_nowait()()
        if self.active is None and self.queue.runs and free:
            following = self.queue.next()
            if following is None:
                self.queue.runs = False
                self.say("queue", "the queue is empty")
            else:
                self._prepare(following)

    def take(self, event: Event, when: float) -> None:
        """Note an event of the run."""
        if self.active is not None and self.active.progress is not None:
            self.active.progress.take(event, when)

    def abort(self, reason: str) -> None:
        """End the run by a controlled stop, or before it begins; the queue halts."""
        self.queue.runs = False
        active = self.active
        if active is None:
            return
        active.pause.withdraw()
        if active.stop is not None:
            with suppress(KeyboardInterrupt):  # raised for a caller in the stage's own thread
                active.stop(reason)
        active.cancelled = reason

    def recover(self) -> None:
        """After a start: runs that the last server left are recovered; nothing is started."""
        for entry in self.queue.entries:
            if entry.status in ("running", "finishing"):
                reason = "the server ended meanwhile"
                self.queue.update(entry.id, status="interrupted", reason=reason)
                self.say("queue", f"{entry.recipe}: interrupted; {reason}", {"id": entry.id})
                if entry.folder is not None and Path(entry.folder).is_dir():
                    self._in_thread(self._recover, Path(entry.folder), entry.id)

    # -- one run --------------------------------------------------------------------------------

    def _prepare(self, stored: Stored) -> None:
        name = stored.entry.recipe
        folder = self.setup.data / f"{name}-{datetime.now():%Y%m%d-%H%M%S}-{stored.entry.id}"
        if stored.request.folder is not None:
            folder = Path(stored.request.folder)
        self.queue.update(stored.entry.id, status="running", folder=str(folder))
        self.active = Active(stored, folder, PauseRequest(self.setup.pause_limit))
        self.say("phase", f"{name}: preparing", {"id": stored.entry.id})
        self._in_thread(self._make_session, self.active)

    def _make_session(self, active: Active) -> None:
        asked, announce = active.stored.request, self.handover.phase
        try:
            setup = setup_for(self.setup, asked)
            recipe = asked_recipe(asked, setup.machine)
            request = run_request(setup, asked, recipe, active.folder)
            if request.host.observer:
                resume = None if asked.resume is None else Path(asked.resume)
                found = find_measurement(request, None, self.setup.machine_file, resume, announce)
                request = replace(request, host=replace(request.host, measurement=found))
            listener = Listener(
                announce,
                self.handover.event,
                stoppable=lambda stop: setattr(active, "stop", stop),
                sample=self.handover.sample,
                pause=active.pause,
            )
            active.progress = _Progress.of(request)
            active.session = make_session(request, listener)
        except StagectlError as why:
            active.error = why
        self._results.put(lambda: self._prepared(active))

    def _prepared(self, active: Active) -> None:
        session = active.session
        if session is None:
            self._ended(active, None)
            return
        if active.cancelled is not None:
            session.give_up(Aborted(active.cancelled))
            self._finish(active)
            return
        active.stage = "running"
        what = f"running {active.stored.entry.recipe}"
        self.begin(what, lambda stage: session.operate(HeldStage(stage)))

    def operated(self, error: BaseException | None) -> None:
        """The stage's thread has ended the run."""
        active = self.active
        if active is None or active.session is None:
            return
        if isinstance(error, StagectlError):
            active.session.give_up(error)
        elif error is not None:
            active.session.give_up(StagectlError(f"internal error: {error}"))
        self._finish(active)

    def _finish(self, active: Active) -> None:
        active.stage = "finishing"
        self.queue.update(active.stored.entry.id, status="finishing")
        self._in_thread(self._make_files, active)

    def _make_files(self, active: Active) -> None:
        assert active.session is not None  # noqa: S101  it has operated
        active.error = active.session.leave()
        problem = make_files(active.folder)
        self._results.put(lambda: self._ended(active, problem))

    def _ended(self, active: Active, problem: str | None) -> None:
        error = active.error
        outcome = (
            "completed" if error is None else "aborted" if isinstance(error, Aborted) else "fault"
        )
        reason = problem if error is None else " ".join(str(error).split())
        verdict = read_verdict(active.folder)
        self.queue.update(
            active.stored.entry.id, status="done", outcome=outcome, reason=reason, verdict=verdict
        )
        if outcome != "completed":
            self.queue.runs = False
        self.active = None
        text = f"{active.stored.entry.recipe}: {outcome}" + (f": {reason}" if reason else "")
        about = {
            "id": active.stored.entry.id, "outcome": outcome, "reason": reason, "verdict": verdict,
            "folder": str(active.folder),
        }  # fmt: skip
        self.say("end", text, about)

    def _recover(self, folder: Path, number: int) -> None:
        problem = make_files(folder)
        said = f"{folder}: recovered" if problem is None else problem
        self._results.put(lambda: self.say("queue", said, {"id": number}))

    def _in_thread(self, work: Callable[..., None], *args: object) -> None:
        def run() -> None:
            try:
                work(*args)
            except Exception as why:  # noqa: BLE001  shown to the operator, whatever it is
                traceback.print_exc(file=sys.stderr)
                text = f"internal error: {type(why).__name__}: {why}"
                self._results.put(lambda: self._broken(text))

        thread = threading.Thread(target=run, name="run", daemon=True)
        self._threads = [each for each in self._threads if each.is_alive()] + [thread]
        thread.start()

    @property
    def is_busy(self) -> bool:
        """Whether a run is under way, or files are being made."""
        return self.active is not None or any(each.is_alive() for each in self._threads)

    def _broken(self, text: str) -> None:
        if self.active is not None:
            self.active.error = StagectlError(text)
            self._ended(self.active, None)


def make_files(folder: Path) -> str | None:
    """Make a run's recording, summary, report and bus log of its journal, in a process of its own.

    Returns:
        What went wrong, or None.
    """
    done = subprocess.run(  # noqa: S603
        [*_NICE, sys.executable, "-m", "stagectl", "recover", str(folder)],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode == 0:
        return None
    return " ".join(done.stderr.split()) or f"{folder}: files could not be made"


_NICE = ["nice", "-n", "10"]


def read_verdict(folder: Path) -> str | None:
    """The verdict in a run's summary, where its recipe has limits."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        verdict = summary.get("limits", {}).get("verdict")
    except (OSError, ValueError, AttributeError):
        return None
    return None if verdict is None else str(verdict)
