"""A run's estimates on their way into the history.

The history must not delay a SYNC or end a run, so a thread writes it (`history.writer`). What that
thread cannot file is in the run's recording as well (`history.filing`); the next run with this
history, or `stagectl history import`, files it from there.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from uuid import uuid4

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
"""Within this distance a move meets the friction of one place [m]."""


def software_version() -> str:
    """Name and version of this program."""
    return f"stagectl {metadata.version('stagectl')}"


class RunHistory:
    """Makes the records of one run, and files them where the run has a history.

    Args:
        entry: of the run.
        open_it: opens the history for writing, in the writer's thread; None for no history.

    Attributes:
        entry: of the run.
        made: estimates so far.
    """

    def __init__(
        self,
        entry: RunEntry,
        open_it: Callable[[], History] | None = None,
    ) -> None:
        self.entry = entry
        self.made = self._steps = 0
        self._open = open_it
        self._writer: HistoryWriter | None = None

    def start(self) -> None:
        """Enter the run, in the writer's thread: the stage is there, its drives not yet enabled."""
        if self._open is not None:
            self._writer = HistoryWriter(self._open, self.entry)

    def estimate(
        self,
        event: FrictionUpdated,
        placed: bool = False,
        temperature: float | None = None,
    ) -> EstimateRecord:
        """The record of an estimate.

        Args:
            event: of the run.
            placed: a map accounts for friction along the path, so that the level measured is the
                target's; without one it is only if the whole move was near it.
            temperature: of the stage [deg C], or None.
        """
        self.made += 1
        estimate = event.estimate
        return EstimateRecord(
            run=0,
            axis=event.axis,
            kind=event.kind,
            site=event.site,
            place=(event.place[0], event.place[1]),
            time=self.entry.started + event.time,
            distance=event.distance,
            accepted=estimate.accepted,
            reason=estimate.reason,
            figures=estimate.figures,
            covariance=tuple(estimate.covariance.ravel().tolist()),
            level=estimate.level,
            measured=measured_level(estimate) if placed or event.reach <= LOCAL else None,
            temperature=temperature,
            number=self.made,
        )

    def step(self, event: LevelStepped) -> StepRecord:
        """The record of a step of the level."""
        self._steps += 1
        return step_record(asdict(event), self.entry, self._steps)

    def file(self, record: EstimateRecord | StepRecord) -> None:
        """Hand a record to the writer, if there is one; never waits."""
        if self._writer is not None:
            self._writer.enqueue(record)

    def end(self, outcome: str, fault: str | None) -> None:
        """Enter how the run ended; waits a few seconds at most, never raises."""
        writer = self._writer
        if writer is not None:
            writer.end(
                lambda history, run: history.end_run(
                    run, outcome, fault, None if writer.dropped else self.made
                )
            )

    @property
    def filed(self) -> int:
        """Number of estimates in the history."""
        return 0 if self._writer is None else self._writer.filed

    def unwritten(self, folder: Path) -> str | None:
        """After `end`: what the history lacks, why, and how to file it; None where it is complete.

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
            "too many were waiting for it" if writer.dropped else "it does not answer"
        )
        command = f"stagectl history import {shlex.quote(str(folder))}"
        return f"{lacks} ({why}); '{command}' files the rest"


def run_entry(request: RunRequest, started: float) -> RunEntry:
    """A run as entered in the history; `started` is its `start_time`."""
    simulated = request.simulated
    recipe, machine = request.recipe, request.machine
    return RunEntry(
        StageKey(machine.name, simulated is not None),
        tuple(machine.axes),
        started,
        recipe.name,
        recipe.lot,
        recipe.wafer,
        software_version(),
        str(request.folder.absolute()),
        purpose="calibration" if recipe.excursions else "production",
        seed=None if simulated is None else simulated.seed,
        uuid=uuid4().hex,
        operator=request.remarks.operator,
        comment=request.remarks.comment,
    )
