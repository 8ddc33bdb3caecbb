"""The history as the rest of the program sees it; SQLite and PostgreSQL stand behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from stagectl.history.records import (
    Activation,
    EstimateRecord,
    Measurement,
    Pair,
    RunEntry,
    StageKey,
    StepRecord,
    StoredMap,
    Trend,
    Wear,
)


class History(Protocol):
    """Friction of any number of stages over time and place.

    Every method that writes is one transaction: there afterwards, or not at all. All of them raise
    `StagectlError` where the database cannot be reached or refuses.
    """

    @property
    def name(self) -> str:
        """How messages call it."""

    def start_run(self, run: RunEntry) -> int:
        """Note a run that begins, unless its uuid is there already; returns its number."""

    def end_run(
        self, run: int, outcome: str | None, fault: str | None = None, estimates: int | None = None
    ) -> None:
        """Note how it ended, and that all it has made is filed.

        Args:
            run: its number.
            outcome: None where it was killed.
            fault: its text.
            estimates: how many it has made; None: not all of them may be here.
        """

    def unfiled(self, stage: StageKey, last: int = 20) -> list[tuple[str, str]]:
        """Uuid and folder of runs that may have made more than is here, the newest first."""

    def filed(self, run: int) -> int:
        """How many estimates of a run are here."""

    def add(self, estimates: Sequence[EstimateRecord]) -> None:
        """Add estimates, accepted or refused, all or none; numbers that are there stay as is."""

    def runs(self, stage: StageKey, last: int = 100) -> list[tuple[int, RunEntry, str | None]]:
        """Number, run and outcome of the last so many runs, newest first."""

    def stages(self) -> list[StageKey]:
        """All stages there is anything of."""

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
        """Accepted estimates of one axis at one place in the order of time.

        Args:
            stage: whose.
            axis: its name.
            place: [m].
            since: nothing earlier [s since 1970].
            until: nothing later.
            last: only so many, the last ones.
            apart: counted back from the last one, those at least so far one from another [s].
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
        """The sliding levels that moves have shown, in the order of time.

        Args:
            stage: whose.
            since: nothing until then [s since 1970].
            until: nothing later.
            each: only so many of every place and axis, the last ones.
            apart: as of `trend`.
        """

    def calibrated(self, stage: StageKey) -> list[tuple[Pair, float]]:
        """Places with the time of their last calibration that an estimate came of."""

    def refused(self, stage: StageKey, last: int = 100) -> list[EstimateRecord]:
        """The last refused estimates, newest first."""

    def wear(self, stage: StageKey, axis: str, since: float, until: float = float("inf")) -> Wear:
        """Moves and distance of an axis after `since`, as far as they were estimated."""

    def add_step(self, step: StepRecord) -> None:
        """Note a step of the level, unless its number is there already."""

    def newest(self, stage: StageKey) -> float | None:
        """When the last estimate was made [s since 1970], None where there is none."""

    def steps(self, stage: StageKey, since: float = float("-inf")) -> list[StepRecord]:
        """Steps of the level in the order of time."""

    def save_map(self, stage: StageKey, made: float, comment: str, content: str) -> int:
        """Keep a new version of the stage's map; returns its number."""

    def maps(self, stage: StageKey) -> list[StoredMap]:
        """All versions in their order."""

    def activate(self, stage: StageKey, number: int | None, time: float, reason: str) -> None:
        """Put a version into use from now on; None: no map.

        Raises:
            ValueError: there is no such version.
        """

    def activations(self, stage: StageKey) -> list[Activation]:
        """What was put into use when, in the order of time."""

    def counted(self, stage: StageKey) -> tuple[int, int]:
        """How many estimates were accepted and refused in all."""

    def close(self) -> None:
        """Let go of it; idempotent."""
