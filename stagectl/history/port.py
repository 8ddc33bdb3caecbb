"""The port to the friction history; SQLite and PostgreSQL are behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from stagectl.errors import UnusableInput
from stagectl.history.records import (
    Activation,
    EstimateRecord,
    Measurement,
    Pair,
    RunEntry,
    RunFilter,
    RunFriction,
    StageKey,
    StepRecord,
    StoredMap,
    Trend,
    Wear,
)


class NoHistory(UnusableInput):
    """There is no history yet; opening it for writing would create one."""


class History(Protocol):
    """Friction of any number of stages over time and place.

    Every method that writes is one transaction. All methods raise `StagectlError` where the
    database cannot be reached or refuses.
    """

    @property
    def name(self) -> str:
        """For messages."""

    def start_run(self, run: RunEntry) -> int:
        """Enter a run, unless its uuid exists already; returns its number."""

    def end_run(
        self, run: int, outcome: str | None, fault: str | None = None, estimates: int | None = None
    ) -> None:
        """Enter how a run ended.

        Args:
            run: its number.
            outcome: None where it was killed.
            fault: its text.
            estimates: number made, all of them filed; None: some may be missing.
        """

    def unfiled(self, stage: StageKey, last: int = 20) -> list[tuple[str, str]]:
        """Uuid and folder of runs with estimates that may be missing, newest first."""

    def filed(self, run: int) -> int:
        """Number of estimates of a run."""

    def add(self, estimates: Sequence[EstimateRecord]) -> None:
        """Add estimates, accepted or refused, all or none; existing numbers are kept."""

    def runs(self, stage: StageKey, last: int = 100) -> list[tuple[int, RunEntry, str | None]]:
        """Number, entry and outcome of the last runs, newest first."""

    def friction_of_runs(self, stage: StageKey, wanted: RunFilter) -> list[RunFriction]:
        """The last runs that a filter leaves, newest first, with the friction they have shown."""

    def stages(self) -> list[StageKey]:
        """All stages in the history."""

    def places(self, stage: StageKey) -> list[Pair]:
        """Places with accepted estimates [m]."""

    def trend(
        self,
        stage: StageKey,
        axis: str,
        place: Pair,
        since: float = float("-inf"),
        until: float = float("inf"),
        last: int | None = None,
        apart: float = 0.0,
    ) -> Trend:
        """Accepted estimates of one axis at one place in order of time.

        Args:
            stage: whose.
            axis: its name.
            place: [m].
            since: nothing earlier [s since 1970].
            until: nothing later.
            last: at most this many, the last ones.
            apart: least time between two of them, counted back from the last one [s].
        """

    def at_date(self, stage: StageKey, when: float) -> list[EstimateRecord]:
        """The last accepted estimate of each place and axis until `when` [s since 1970]."""

    def measurements(
        self,
        stage: StageKey,
        since: float = float("-inf"),
        until: float = float("inf"),
        each: int | None = None,
        apart: float = 0.0,
    ) -> list[Measurement]:
        """Sliding levels measured by moves, in order of time.

        Args:
            stage: whose.
            since: nothing until then [s since 1970].
            until: nothing later.
            each: at most this many of every place and axis, the last ones.
            apart: as in `trend`.
        """

    def calibrated(self, stage: StageKey) -> list[tuple[Pair, float]]:
        """Places, with the time of their last successful calibration."""

    def refused(self, stage: StageKey, last: int = 100) -> list[EstimateRecord]:
        """The last refused estimates, newest first."""

    def wear(self, stage: StageKey, axis: str, since: float, until: float = float("inf")) -> Wear:
        """Moves and distance of an axis after `since`, counting moves with an estimate."""

    def add_step(self, step: StepRecord) -> None:
        """Add a step of the level, unless its number exists already."""

    def newest(self, stage: StageKey) -> float | None:
        """Time of the last estimate [s since 1970]; None where there is none."""

    def steps(self, stage: StageKey, since: float = float("-inf")) -> list[StepRecord]:
        """Steps of the level in order of time."""

    def save_map(self, stage: StageKey, made: float, comment: str, content: str) -> int:
        """Save a new version of the stage's map; returns its number."""

    def maps(self, stage: StageKey) -> list[StoredMap]:
        """All versions in order."""

    def activate(self, stage: StageKey, number: int | None, time: float, reason: str) -> None:
        """Make a version the active one; None: no map is active.

        Raises:
            ValueError: there is no such version.
        """

    def activations(self, stage: StageKey) -> list[Activation]:
        """All activations in order of time."""

    def counted(self, stage: StageKey) -> tuple[int, int]:
        """Numbers of accepted and refused estimates."""

    def close(self) -> None:
        """Close it; idempotent."""
