"""A run's estimates as records, on their way into the history.

The history is never worth a run, nor a SYNC: records go to a thread of their own
(`history.writer`). What it can't file is in the run's recording all the same (`history.noted`), and
is filed from there by the next run with that history, or by `stagectl history import`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from uuid import uuid4

from estimation.online import FIGURES, MASS
from stagectl.history import (
    EstimateRecord,
    History,
    HistoryWriter,
    RunEntry,
    StageKey,
    StepRecord,
    measured_level,
    step_record,
)
from stagectl.run.request import RunRequest
from stagectl.sequencer import FrictionUpdated, LevelStepped

LOCAL = 5e-3
"""A move within this distance meets the friction of one place [m]."""


def software() -> str:
    """Name and version of what makes the estimates."""
    return f"stagectl {metadata.version('stagectl')}"


class RunHistory:
    """Makes one run's records, and hands them on where the run has a history.

    Args:
        entry: the run that begins now.
        history: open for writing, to note the run in; None for none.
        reopen: opens the same history again, for the writer's thread.

    Attributes:
        entry: of the run.
        number: of the run in the history, 0 without one.
        made: estimates so far.

    Raises:
        StagectlError: the run cannot be noted; nothing has moved yet.
    """

    def __init__(
        self,
        entry: RunEntry,
        history: History | None = None,
        reopen: Callable[[], History] | None = None,
    ) -> None:
        self.entry = entry
        self.made = self._steps = 0
        self._reopen = reopen
        self._writer: HistoryWriter | None = None
        self.number = 0 if history is None else history.start_run(entry)

    def start(self) -> None:
        """Begin to file, before the drives are under way."""
        if self._reopen is not None:
            self._writer = HistoryWriter(self._reopen)

    def estimate(
        self,
        event: FrictionUpdated,
        placed: bool = False,
        temperature: float | None = None,
    ) -> EstimateRecord:
        """The record of what the estimator made of a move.

        Args:
            event: of the run.
            placed: friction on the way was known from a map, so that the move's level is that of
                its target; else it is only where the whole move was near it.
            temperature: [deg C], where there is one.
        """
        self.made += 1
        estimate = event.estimate
        return EstimateRecord(
            run=self.number,
            axis=event.axis,
            kind=event.kind,
            site=event.site,
            place=(event.place[0], event.place[1]),
            time=self.entry.started + event.time,
            distance=event.distance,
            accepted=estimate.accepted,
            reason=estimate.reason,
            figures={name: float(getattr(estimate.friction, name)) for name in FIGURES[:MASS]},
            covariance=tuple(estimate.covariance.ravel().tolist()),
            level=estimate.level,
            measured=measured_level(estimate) if placed or event.reach <= LOCAL else None,
            temperature=temperature,
            number=self.made,
        )

    def step(self, event: LevelStepped) -> StepRecord:
        """The record of a step of the level."""
        self._steps += 1
        return step_record(asdict(event), self.entry, self.number, self._steps)

    def file(self, record: EstimateRecord | StepRecord) -> None:
        """Hand a record to the history's thread, where there is one; never waits."""
        if self._writer is not None:
            self._writer.hand_over(record)

    def end(self, outcome: str, fault: str | None) -> None:
        """Note how the run ended; waits some seconds at most, never raises."""
        writer = self._writer
        if writer is not None:
            writer.end(
                lambda history: history.end_run(
                    self.number, outcome, fault, None if writer.turned_away else self.made
                )
            )

    @property
    def filed(self) -> int:
        """How many of the estimates the history has."""
        return 0 if self._writer is None else self._writer.filed

    def unwritten(self, folder: Path) -> str | None:
        """After the end: what the history lacks, why, and what to do about it; None where nothing.

        Args:
            folder: of the run's files.
        """
        writer = self._writer
        if writer is None or writer.complete:
            return None
        lacks = f"{self.filed} of {self.made} estimates in the history"
        if self.filed == self.made:
            lacks = "how the run ended is not in the history"
        why = writer.failure or (
            "too many were waiting for it" if writer.turned_away else "it does not answer"
        )
        return f"{lacks} ({why}); 'stagectl history import {folder}' files the rest"


def begins(history: History | None, request: RunRequest) -> float:
    """When a run begins, as its history counts [s since 1970].

    A virtual stage has a time of its own, which goes faster than this computer's: it goes on where
    the stage's last run ended, so that nothing that was learned then lies in this run's future.
    """
    now = request.started.timestamp()
    if request.truth is None or history is None:
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
        str(request.folder.absolute()),
        purpose="calibration" if recipe.excursions else "production",
        seed=request.seed if simulated else None,
        uuid=uuid4().hex,
    )
