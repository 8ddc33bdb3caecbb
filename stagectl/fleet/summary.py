"""What a fleet's results say: the worst stages, effects, what they share, drifts, what is due."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from sim2real.findings import INSUFFICIENT, UNEXPLAINED
from stagectl.calibration import ACT
from stagectl.errors import UnusableInput
from stagectl.fleet.history import friction_rows
from stagectl.fleet.ledger import Ledger
from stagectl.fleet.patterns import Common, Drift, find_common, find_drifts
from stagectl.fleet.rows import REFUSED, Row
from stagectl.fleet.stages import COULOMB, Series, StageState, series_of, stage_states
from stagectl.fleet.storage import Folder

FORMAT, VERSION = "stagectl-fleet-summary", 1
AHEAD = 30.0
"""How far ahead a drift is followed [days]."""


@dataclass(frozen=True, slots=True)
class Due:
    """What is to be done about a stage.

    Attributes:
        stage: its name.
        what: to do.
        why: one clause.
        within: days until then; 0 for now.
    """

    stage: str
    what: str
    why: str
    within: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """All that is said.

    Attributes:
        recordings: results, refused ones included.
        stages: the worst first.
        common: patterns of effects.
        drifts: largest change first.
        due: the most urgent first.
        refused: recordings that cannot be used -> reason.
        failures: recordings without a result -> reason.
        series: of all stages.
    """

    recordings: int
    stages: Sequence[StageState]
    common: Sequence[Common]
    drifts: Sequence[Drift]
    due: Sequence[Due]
    refused: Mapping[str, str]
    failures: Mapping[str, str]
    series: Sequence[Series]

    def to_json(self) -> dict[str, Any]:
        """As in docs/formats/fleet.md."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "recordings": self.recordings,
            "stages": [
                {
                    "stage": of.key.machine,
                    "simulated": of.key.simulated,
                    "recordings": of.recordings,
                    "last": None if of.last is None else of.last.isoformat(),
                    "floors": of.floors,
                    "verdict": of.verdict,
                    "reason": of.reason,
                    "effects": [asdict(effect) for effect in of.effects],
                    "channels": list(of.channels),
                }
                for of in self.stages
            ],
            "common": [asdict(each) for each in self.common],
            "drifts": [
                {
                    "stage": of.series.key.machine,
                    "simulated": of.series.key.simulated,
                    "axis": of.series.axis,
                    "figure": of.series.figure,
                    "per_day": of.per_day,
                    "interval": list(of.interval),
                    "change": of.change,
                    "days": of.days,
                    "chance": of.chance,
                }
                for of in self.drifts
            ],
            "due": [asdict(each) for each in self.due],
            "refused": dict(self.refused),
            "failures": dict(self.failures),
        }


def summarise(folder: Folder) -> tuple[Summary, list[Row], list[Row]]:
    """The summary of a folder of results, its rows, and the friction of runs beside them.

    Raises:
        UnusableInput: no results, or damaged ones.
    """
    ledger = Ledger(folder)
    rows, friction = list(ledger.rows()), friction_rows(folder)
    if not rows and not friction:
        raise UnusableInput(f"{folder.address}: no results; 'stagectl fleet diagnose' makes them")
    stages = stage_states(rows)
    series = series_of(rows, friction)
    drifts = find_drifts(series)
    refused = {row["recording"]: row["reason"] for row in rows if row["verdict"] == REFUSED}
    due = [*_of_effects(stages), *_of_drifts(drifts), *_of_evidence(stages)]
    due.sort(key=lambda each: each.within)
    summary = Summary(
        len(rows), stages, find_common(stages), drifts, due, refused, ledger.failures(), series
    )
    return summary, rows, friction


def _of_effects(stages: Sequence[StageState]) -> list[Due]:
    """Remedies of effects, and faulty channels."""
    due = []
    for stage in stages:
        for e in stage.effects:
            why = f"{e.effect} on {e.axis} in {e.recordings} of the last {stage.latest} recordings"
            due.append(Due(str(stage.key), e.remedy, why))
        due += [Due(str(stage.key), "Correct the channel.", text) for text in stage.channels]
    return due


def _of_drifts(drifts: Sequence[Drift]) -> list[Due]:
    """Calibrations, as friction changes by what a calibration acts on."""
    due = []
    for drift in drifts:
        rate = drift.per_day / drift.start
        days = max(ACT / abs(rate) - drift.days, 0.0)
        if drift.series.figure == COULOMB and days <= AHEAD:
            why = (
                f"the Coulomb force of {drift.series.axis} has changed by "
                f"{100 * drift.change:+.0f} % in {drift.days:.0f} days"
            )
            due.append(Due(str(drift.series.key), "Calibrate the friction.", why, days))
    return due


def _of_evidence(stages: Sequence[StageState]) -> list[Due]:
    """Better recordings, where these do not say enough."""
    what = "Record what 'stagectl gap excite' proposes."
    return [
        Due(str(stage.key), what, stage.reason)
        for stage in stages
        if stage.verdict in (INSUFFICIENT, UNEXPLAINED)
    ]
