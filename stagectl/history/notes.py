"""A run's records as notes in its recording, for a history that did not get all of them.

The event `run` holds the run's row of the history, each event `friction` that of an estimate, and
`level_stepped` that of a step: docs/formats/recording.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from stagectl.errors import UnusableInput
from stagectl.history.records import EstimateRecord, RunEntry, StageKey, StepRecord
from stagectl.store import RunNotes

_IN_EVENT = ("run", "axis", "site", "accepted", "reason")
"""Fields of an estimate that its event has anyway, or that only the database knows."""
_NOTED = tuple(f.name for f in fields(EstimateRecord) if f.name not in _IN_EVENT)


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The records of a run, from its recording.

    Attributes:
        entry: of the run.
        where: history that it used, without a password; None for none.
        estimates, steps: all of them in order, with run number 0.
        outcome: None where the run was killed.
        fault: its text.
    """

    entry: RunEntry
    where: str | None
    estimates: tuple[EstimateRecord, ...]
    steps: tuple[StepRecord, ...]
    outcome: str | None
    fault: str | None


def note_of_run(entry: RunEntry, where: str | None) -> dict[str, Any]:
    """The note in the event `run`."""
    return {"where": where, **asdict(entry)}


def note_of_estimate(record: EstimateRecord) -> dict[str, Any]:
    """The note in the event `friction`."""
    return {name: getattr(record, name) for name in _NOTED}


def step_record(event: Mapping[str, Any], entry: RunEntry, number: int) -> StepRecord:
    """A step of the level as a row of the history.

    Args:
        event: fields of a `LevelStepped`.
        entry: the run.
        number: of the step in the run, from 1.
    """
    x, y = event["place"]
    return StepRecord(
        0, str(event["axis"]), (float(x), float(y)), entry.started + float(event["time"]),
        float(event["change"]), "common" if event["everywhere"] else "site", number,
    )  # fmt: skip


def recorded_run(notes: RunNotes, path: Path) -> RecordedRun:
    """The records of a run from its notes.

    Args:
        notes: of its recording, or of the journal of a killed run.
        path: they were read from, for errors.

    Raises:
        UnusableInput: an older version wrote them without records, or they are damaged.
    """
    run = next((e for e in notes.events if e.get("event") == "run"), None)
    if run is None or "history" not in run:
        raise UnusableInput(
            f"{path}: lacks the records that a history needs (made by an older version)"
        )
    try:
        entry = _entry(run["history"])
        where = run["history"]["where"]
        return RecordedRun(
            entry,
            None if where is None else str(where),
            tuple(_estimate(e) for e in notes.events if e["event"] == "friction"),
            tuple(
                step_record(e, entry, number)
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
        _text(note.get("operator")), _text(note.get("comment")),
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
