"""A run's estimates on their way into the history.

The history is never worth a run: where it cannot be written any more (disk full, server gone,
another program at it) that is kept in `failure`, and the run goes on without waiting again. What
was not written is tried once more at the end; the run's own files hold the estimates all the same.
"""

from __future__ import annotations

from importlib import metadata

from estimation.belief import FIGURES, MASS
from stagectl.errors import StagectlError
from stagectl.history.measured import measured_level
from stagectl.history.port import History
from stagectl.history.records import EstimateRecord, RunEntry, StageKey, StepRecord
from stagectl.request import RunRequest
from stagectl.sequencer.events import FrictionUpdated, LevelStepped

LOCAL = 5e-3
"""A move within this distance meets the friction of one place [m]."""


def software() -> str:
    """Name and version of what makes the estimates."""
    return f"stagectl {metadata.version('stagectl')}"


class RunHistory:
    """Writes one run's estimates as they come.

    Args:
        history: open for writing; closed by `end`.
        run: that begins now.

    Attributes:
        failure: why the history is not whole, or None.
        number: of the run in the history.

    Raises:
        StagectlError: the run cannot be noted; nothing has moved yet.
    """

    def __init__(self, history: History, run: RunEntry) -> None:
        self.failure: str | None = None
        self._estimates: list[EstimateRecord] = []
        self._steps: list[StepRecord] = []
        self._history, self._run = history, run
        self.number = history.start_run(run)

    def note(
        self,
        event: FrictionUpdated,
        placed: bool = False,
        temperature: float | None = None,
    ) -> None:
        """Add what the estimator made of a move.

        Args:
            event: of the run.
            placed: friction on the way was known from a map, so that the move's level is that of
                its target; else it is only where the whole move was near it.
            temperature: [deg C], where there is one.
        """
        estimate = event.estimate
        record = EstimateRecord(
            run=self.number,
            axis=event.axis,
            kind=event.kind,
            site=event.site,
            place=(event.place[0], event.place[1]),
            time=self._run.started + event.time,
            distance=event.distance,
            accepted=estimate.accepted,
            reason=estimate.reason,
            figures={name: float(getattr(estimate.friction, name)) for name in FIGURES[:MASS]},
            covariance=tuple(estimate.covariance.ravel().tolist()),
            level=estimate.level,
            measured=measured_level(estimate) if placed or event.reach <= LOCAL else None,
            temperature=temperature,
        )
        self._estimates.append(record)
        if self.failure is None:
            self._write()

    def note_step(self, event: LevelStepped) -> None:
        """Add a step of the level."""
        kind = "common" if event.everywhere else "site"
        time = self._run.started + event.time
        self._steps.append(
            StepRecord(self.number, event.axis, event.place, time, event.change, kind)
        )
        if self.failure is None:
            self._write()

    def end(self, outcome: str, fault: str | None) -> None:
        """Note how the run ended, and let go of the history; never raises."""
        self.failure = None
        try:
            self._write()
            if self.failure is None:
                self._history.end_run(self.number, outcome, fault)
        except StagectlError as error:
            self.failure = str(error)
        finally:
            self._history.close()

    def _write(self) -> None:
        """What is not there yet."""
        try:
            if self._estimates:
                self._history.add(self._estimates)
                self._estimates = []
            while self._steps:
                self._history.add_step(self._steps[0])
                del self._steps[0]
        except StagectlError as error:
            self.failure = str(error)


def begins(history: History, request: RunRequest) -> float:
    """When a run begins, as its history counts [s since 1970].

    A virtual stage has a time of its own, which goes faster than this computer's: it goes on where
    the stage's last run ended, so that nothing that was learned then lies in this run's future.
    """
    now = request.started.timestamp()
    if request.truth is None:
        return now
    newest = history.newest(StageKey(request.machine.name, simulated=True))
    return now if newest is None else max(now, newest + 1.0)


def run_entry(request: RunRequest, started: float) -> RunEntry:
    """A run as the history notes it; `started`: as `begins` says."""
    simulated = request.truth is not None
    recipe, machine = request.recipe, request.machine
    return RunEntry(
        StageKey(machine.name, simulated),
        tuple(machine.axes),
        started,
        recipe.name,
        recipe.lot,
        recipe.wafer,
        software(),
        str(request.folder),
        purpose="calibration" if recipe.excursions else "production",
        seed=request.seed if simulated else None,
    )
