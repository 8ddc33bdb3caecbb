"""A run's records as they stand in its recording, for a history that did not get all of them.

The event `run` names the run as the history knows it, each event `friction` holds the estimate's
whole row, and `level_stepped` says all there is of a step: docs/formats/recording.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from stagectl.errors import UnusableInput
from stagectl.history.records import EstimateRecord, RunEntry, StageKey, StepRecord
from stagectl.store import RunNotes

_IN_EVENT = ("run", "axis", "site", "accepted", "reason")
"""What of an estimate its event has anyway, or only the database knows."""


@dataclass(frozen=True, slots=True)
class NotedRun:
    """What a recording tells the history.

    Attributes:
        entry: the run.
        where: history that it wrote to, without a password; None for none.
        estimates, steps: all of them in their order, with run number 0.
        outcome: None where the run was killed.  fault: its text.
    """

    entry: RunEntry
    where: str | None
    estimates: tuple[EstimateRecord, ...]
    steps: tuple[StepRecord, ...]
    outcome: str | None
    fault: str | None


def note_of_run(entry: RunEntry, where: str | None) -> dict[str, Any]:
    """For the event `run`."""
    return {"where": where, **asdict(entry)}


def note_of_estimate(record: EstimateRecord) -> dict[str, Any]:
    """For the event `friction`."""
    return {name: value for name, value in asdict(record).items() if name not in _IN_EVENT}


def step_record(event: Mapping[str, Any], entry: RunEntry, run: int, number: int) -> StepRecord:
    """A step as the history has it.

    Args:
        event: fields of a `LevelStepped`.
        entry: the run.
        run: its number in the history.
        number: of the step in the run, from 1.
    """
    x, y = event["place"]
    return StepRecord(
        run, str(event["axis"]), (float(x), float(y)), entry.started + float(event["time"]),
        float(event["change"]), "common" if event["everywhere"] else "site", number,
    )  # fmt: skip


def noted_run(notes: RunNotes, path: Path) -> NotedRun:
    """What a recording, or the journal of a killed run, tells the history.

    Args:
        notes: of the run.
        path: they were read from, for errors.

    Raises:
        UnusableInput: it tells nothing, being another version's, or is damaged.
    """
    run = next((e for e in notes.events if e.get("event") == "run"), None)
    if run is None or "history" not in run:
        raise UnusableInput(
            f"{path}: does not hold its estimates as a history has them (made by an older version)"
        )
    try:
        entry = _entry(run["history"])
        where = run["history"]["where"]
        return NotedRun(
            entry,
            None if where is None else str(where),
            tuple(_estimate(e) for e in notes.events if e["event"] == "friction"),
            tuple(
                step_record(e, entry, 0, number)
                for number, e in enumerate(
                    (e for e in notes.events if e["event"] == "level_stepped"), 1
                )
            ),
            None if notes.outcome in ("", "killed") else notes.outcome,
            notes.fault,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UnusableInput(f"{path}: /events: damaged ({type(error).__name__}: {error})") from None


def _entry(note: Mapping[str, Any]) -> RunEntry:
    stage = StageKey(str(note["stage"]["machine"]), bool(note["stage"]["simulated"]))
    return RunEntry(
        stage, tuple(map(str, note["axes"])), float(note["started"]), str(note["recipe"]),
        _text(note["lot"]), _text(note["wafer"]), str(note["software"]), str(note["folder"]),
        "calibration" if note["purpose"] == "calibration" else "production",
        None if note["seed"] is None else int(note["seed"]), str(note["uuid"]),
    )  # fmt: skip


def _estimate(event: Mapping[str, Any]) -> EstimateRecord:
    note = event["record"]
    (x, y), measured, temperature = note["place"], note["measured"], note["temperature"]
    return EstimateRecord(
        run=0, axis=str(event["axis"]), kind=str(note["kind"]),
        site=None if event["site"] is None else int(event["site"]),
        place=(float(x), float(y)), time=float(note["time"]), distance=float(note["distance"]),
        accepted=bool(event["accepted"]), reason=_text(event["reason"]),
        figures={str(name): float(value) for name, value in note["figures"].items()},
        covariance=tuple(map(float, note["covariance"])), level=float(note["level"]),
        measured=None if measured is None else (float(measured[0]), float(measured[1])),
        temperature=None if temperature is None else float(temperature),
        number=int(note["number"]),
    )  # fmt: skip


def _text(value: object) -> str | None:
    return None if value is None else str(value)
