"""The history as the rest of the program sees it; SQLite and PostgreSQL stand behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from stagectl.history.records import EstimateRecord, Pair, RunEntry, StageKey, Trend


class History(Protocol):
    """Friction of any number of stages over time and place.

    Every method that writes is one transaction: there afterwards, or not at all. All of them raise
    `StagectlError` where the database cannot be reached or refuses.
    """

    @property
    def name(self) -> str:
        """How messages call it."""

    def start_run(self, run: RunEntry) -> int:
        """Note a run that begins; returns its number."""

    def end_run(self, run: int, outcome: str, fault: str | None = None) -> None:
        """Note how it ended; a run without an outcome was killed, or goes on."""

    def add(self, estimates: Sequence[EstimateRecord]) -> None:
        """Add estimates, accepted or refused, all or none."""

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
    ) -> Trend:
        """Accepted estimates of one axis at one place in the order of time."""

    def at_date(self, stage: StageKey, when: float) -> list[EstimateRecord]:
        """The last accepted estimate of each place and axis until `when` [s since 1970]."""

    def refused(self, stage: StageKey, last: int = 100) -> list[EstimateRecord]:
        """The last refused estimates, newest first."""

    def counted(self, stage: StageKey) -> tuple[int, int]:
        """How many estimates were accepted and refused in all."""

    def close(self) -> None:
        """Let go of it; idempotent."""
