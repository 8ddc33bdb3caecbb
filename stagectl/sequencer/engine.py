"""Runs a plan step by step: macro-move, settle, estimate, micro-move, settle, expose.

The compensation learns from each move before the next one begins. A request to stop brings the
stage to rest along a trajectory and raises `Aborted`. Faults of the drives pass through as the
driver's exceptions; the stage has been stopped by then. How a move is made: `mover`.
Opening, homing and disabling the stage, files and the display are `stagectl.run`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from estimation.trajectory import Limits
from stagectl.errors import Aborted, RunFault
from stagectl.recipe import (
    DoneStep,
    Dwell,
    Excite,
    ExposeStep,
    Fiducial,
    FiducialStep,
    MarkedStep,
    MoveStep,
    Settle,
)
from stagectl.sequencer import events
from stagectl.sequencer.compensation.places import Places
from stagectl.sequencer.events import Event
from stagectl.sequencer.excitation import excitation_setpoints
from stagectl.sequencer.mover import Mover, MovingAxis
from stagectl.sequencer.streamer import StagePort
from stagectl.sequencer.unrest import Unrest
from stagedata import Move

LEAD_IN = 0.1
"""Rest before the first move, to measure the force at rest [s]."""
PAUSE_STEP = 0.1
"""Between two looks at whether a pause is over [s]."""
MAX_RETRIES = 3
"""Further waits of `on_timeout: retry` before the run stops."""


class StopRequest:
    """A stop asked for by a signal handler or another thread, and polled on every SYNC.

    Args:
        noticed: called with the reason when the request is first seen, which is when it acts.
    """

    def __init__(self, noticed: Callable[[str], object]) -> None:
        self.reason: str | None = None
        self._noticed: Callable[[str], object] | None = noticed

    def __call__(self, reason: str) -> None:
        """Ask for a controlled stop; the first reason is kept."""
        if self.reason is None:
            self.reason = reason

    def is_asked(self) -> bool:
        """Whether a stop has been asked for."""
        if self.reason is None:
            return False
        if self._noticed is not None:
            noticed, self._noticed = self._noticed, None
            noticed(self.reason)
        return True


class PauseRequest:
    """A pause asked for by another thread; it begins where a segment of the recipe is complete.

    Args:
        most: longest pause [s]; a run that is paused for longer ends.
    """

    def __init__(self, most: float = 600.0) -> None:
        self.most = most
        self._asked = False

    def ask(self) -> None:
        """Ask for a pause."""
        self._asked = True

    def withdraw(self) -> None:
        """Let the run go on."""
        self._asked = False

    def is_asked(self) -> bool:
        """Whether a pause is asked for."""
        return self._asked


class Engine:
    """Runs a plan on a stage.

    Args:
        stage: enabled in csp, at rest.
        axes: in the order of the plan's coordinates.
        fiducial: finds the targets of the micro-moves.
        period: Ts [s].
        on_move: called with each move before its first sample.
        on_event: called with each event.
        places: friction over the table; None where it is taken to be the same everywhere.
        pause: asked for a pause after each segment.

    Attributes:
        stop: call it with a reason for a controlled stop.
    """

    def __init__(
        self,
        stage: StagePort,
        axes: Sequence[MovingAxis],
        fiducial: Fiducial,
        period: float,
        on_move: Callable[[Move], object],
        on_event: Callable[[Event], object],
        places: Places | None = None,
        pause: PauseRequest | None = None,
    ) -> None:
        self._pause = PauseRequest() if pause is None else pause
        self.stop = StopRequest(lambda reason: on_event(events.StopNoticed(reason)))
        self._mover = Mover(stage, axes, period, self.stop.is_asked, places)
        self._fiducial = fiducial
        self._period = period
        self._on_move, self._on_event = on_move, on_event
        self._window: float | None = None
        self._unrest = Unrest(
            [axis.name for axis in axes], [axis.increment for axis in axes], period
        )
        self._site: int | None = None
        self._site_position: tuple[float, ...] = tuple(self._mover.target)
        self._place: tuple[float, ...] | None = None
        self._mark: tuple[float, float] | None = None

    @property
    def samples(self) -> int:
        """SYNCs streamed so far."""
        return self._mover.samples

    def restart(self, samples: int) -> Move | None:
        """Start again after a fault, with the stage enabled at rest and its friction state unknown.

        Args:
            samples: SYNCs streamed so far, those of the interrupted stream included.

        Returns:
            The interrupted move, ending where it really did; None where there was none.
        """
        self._mark = None
        self._site_position = tuple(self._mover.target)
        return self._mover.restart(samples)

    def run(self, steps: Sequence[MarkedStep]) -> None:
        """Carry out the steps; the stage ends at rest, enabled, its force offsets in effect.

        Raises:
            Aborted: a stop was asked for; the stage is at rest.
            RunFault: a move did not settle and the recipe says stop, the stage being at rest; or
                the following error is too large, and the caller has to stop the stage.
            drivers.DriverError: an axis or the bus failed; all axes are stopped.
        """
        try:
            self._hold(LEAD_IN)
            for step in steps:
                self._do(step)
            self._learn()
        except (Aborted, RunFault) as end:
            self._on_event(events.Stopping(str(end)))
            raise

    def _do(self, step: MarkedStep) -> None:
        match step:
            case MoveStep():
                self._move(step)
            case Excite():
                self._excite(step)
            case Settle():
                self._settle(step)
            case FiducialStep():
                self._find_mark(step.site)
            case ExposeStep():
                self._on_event(events.Waiting(self._site, "exposing", step.duration))
                self._hold(step.duration)
                self._on_event(events.Exposed(self._site))
            case Dwell():
                self._on_event(events.Waiting(self._site, "dwelling", step.duration))
                self._hold(step.duration)
            case DoneStep():
                self._on_event(events.SegmentDone(step.number, step.site))
                self._pause_here()

    def _move(self, step: MoveStep) -> None:
        self._learn()
        target = self._target_of(step)
        if target is None:
            return
        self._site = step.site
        if step.kind == "macro":
            self._site_position = target
        self._place = step.place
        profile = step.profile
        limits = Limits(profile.velocity, profile.acceleration, profile.jerk)
        self._on_event(events.MoveStarted(step.site, step.kind, self._mover.time))
        if not self._mover.move_to(
            target, limits, step.kind, step.site, self._on_move, step.place or target
        ):
            self._check_stop()

    def _excite(self, excitation: Excite) -> None:
        self._learn()
        self._site = self._place = None
        self._on_event(events.MoveStarted(None, "other", self._mover.time))
        if not self._mover.excite(
            excitation.axis, excitation_setpoints(excitation, self._period), self._on_move
        ):
            self._check_stop()

    def _target_of(self, step: MoveStep) -> tuple[float, ...] | None:
        """Absolute target on the grid of the setpoints; None where the mark was not found."""
        wanted, self._mark = step.end(self._mover.target.tolist(), self._mark), None
        return None if wanted is None else self._mover.on_grid(wanted)

    def _find_mark(self, site: int) -> None:
        self._on_event(events.Waiting(site, "looking for the mark", None))
        x, y = self._site_position
        found = self._fiducial.find(site, (x, y))
        self._mark = None if found is None else (x + found[0], y + found[1])
        self._on_event(
            events.MarkNotFound(site) if found is None else events.MarkFound(site, found)
        )

    def _settle(self, step: Settle) -> None:
        """Wait until the last move has settled; without a move (no mark) there is nothing to do."""
        move = self._mover.move
        if move is None:
            return
        attempts = 1 + (MAX_RETRIES if step.on_timeout == "retry" else 0)
        for _ in range(attempts):
            self._on_event(events.Waiting(move.site, "settling", max(step.timeout, step.hold)))
            waited, settled = self._wait(step)
            self._on_event(events.Settled(move.site, move.kind, waited, settled))
            self._window = step.window
            self._tell_unrest(self._unrest.after_settling(move.kind, waited))
            if settled or step.on_timeout == "continue":
                return
        where = "" if move.site is None else f"site {move.site}: "
        raise RunFault(
            f"{where}{move.kind}-move did not settle to +-{step.window * 1e9:g} nm within "
            f"{attempts * step.timeout * 1e3:g} ms (on_timeout: {step.on_timeout})"
        )

    def _wait(self, step: Settle) -> tuple[float, bool]:
        """Hold until all axes have stayed in the window; time waited [s], and whether they have."""
        window, targets = step.window, tuple(self._mover.target.tolist())
        needed = max(1, round(step.hold / self._period))
        inside = 0

        def settled(position: tuple[float, ...]) -> bool:
            nonlocal inside
            inside += 1
            for actual, target in zip(position, targets, strict=True):
                if not -window <= actual - target <= window:
                    inside = 0
            return inside >= needed

        begin = self._mover.time
        self._mover.hold(max(step.timeout, step.hold), settled)
        if inside < needed:
            self._check_stop()
        return self._mover.time - begin, inside >= needed

    def _hold(self, duration: float) -> None:
        self._mover.hold(duration)
        self._check_stop()

    def _learn(self) -> None:
        move, samples = self._mover.move, self._mover.streamed()
        if self._window is not None and samples is not None:
            self._tell_unrest(self._unrest.in_samples(samples, self._window))
        for axis, learned in self._mover.learn():
            assert move is not None  # noqa: S101  nothing is learned without a move
            site = move.site
            place = self._place or (
                tuple(move.target.values()) if site is None else self._site_position
            )
            self._on_event(
                events.FrictionUpdated(
                    site,
                    axis,
                    learned.estimate,
                    learned.compute_time,
                    move.kind,
                    place,
                    abs(move.distance(axis)),
                    self._mover.time,
                    max(abs(move.distance(name)) for name in move.target),
                    learned.local,
                )
            )

    def _tell_unrest(self, texts: Sequence[str]) -> None:
        for text in texts:
            self._on_event(events.Limitation(text))

    def _pause_here(self) -> None:
        """Hold for as long as a pause is asked for.

        Raises:
            Aborted: for too long, or a stop was asked for.
        """
        if not self._pause.is_asked():
            return
        self._learn()
        begin, most = self._mover.time, self._pause.most
        self._on_event(events.Paused(most))
        while self._pause.is_asked():
            if self._mover.time - begin >= most:
                raise Aborted(f"paused for longer than {most:g} s")
            self._hold(PAUSE_STEP)
        self._on_event(events.Continued(self._mover.time - begin))

    def _check_stop(self) -> None:
        if self.stop.is_asked():
            raise Aborted(self.stop.reason or "stopped")
