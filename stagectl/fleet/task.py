"""The work on one recording, in a worker: read it, diagnose it, write its row.

It can be done any number of times: the row's file is named by all that the row depends on, appears
completely or not at all, and is not computed again where it exists.
"""

from __future__ import annotations

import ctypes
import gc
import hashlib
import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stagectl.errors import ConfigError, UnusableInput
from stagectl.fleet.rows import REFUSED, RESULT, Row, from_parquet, to_parquet
from stagectl.fleet.storage import Folder, content_of, local_copy
from stagectl.run import software_version

if TYPE_CHECKING:
    from sim2real.findings import GapReport
    from stagectl.config import Machine

RESULTS = "results"
"""Folder of the rows."""
_BETWEEN_COLLECTIONS = 10
"""Diagnoses between two searches for cycles."""
_DONE = count(1)


@dataclass(frozen=True, slots=True)
class Job:
    """What to do.

    Attributes:
        url: of the recording.
        stamp: of it, when it was listed.
        out: address of the folder for results.
        machine: text and name of a machine file in place of the recording's own, or None.
        correct: continue with corrected channels.
        version: of the program that asks.
    """

    url: str
    stamp: str
    out: str
    machine: tuple[str, str] | None
    correct: bool
    version: str

    def result(self, content: str) -> str:
        """Name of the row's file, for a recording of this content (SHA-256)."""
        machine = None if self.machine is None else self.machine[0]
        of = json.dumps([content, machine, self.correct, self.version])
        key = hashlib.sha256(of.encode()).hexdigest()[:40]
        return f"{RESULTS}/{key[:2]}/{key}.parquet"


@dataclass(frozen=True, slots=True)
class Done:
    """A finished job.

    Attributes:
        url, stamp: of the recording.
        content: SHA-256 of it.
        result: name of the row's file.
        reused: it existed.
        refusal: why the recording cannot be used; None where it can.
    """

    url: str
    stamp: str
    content: str
    result: str
    reused: bool
    refusal: str | None


def diagnose_one(job: Job) -> Done:
    """Diagnose one recording, unless that has been done.

    Raises:
        RuntimeError: this computer has another version of the program.
        StagectlError: the row cannot be written.
        Exception: anything that goes wrong in the diagnosis; a recording that cannot be used is a
            row with its reason.
    """
    if job.version != software_version():
        raise RuntimeError(f"worker has {software_version()}, {job.version} asks")
    folder = Folder(job.out)
    with local_copy(job.url) as path:
        content = content_of(path)
        name = job.result(content)
        reused = folder.has(name)
        row = _kept(folder, name) if reused else _row(job, path)
    if not reused and folder.has(name):  # asked for twice, and another worker was sooner
        row, reused = _kept(folder, name), True
    if not reused:
        row |= {"recording": job.url, "content": content, "version": job.version}
        folder.write(name, to_parquet([row], RESULT))
        _return_memory()
    refusal = row["reason"] if row["verdict"] == REFUSED else None
    return Done(job.url, job.stamp, content, name, reused, refusal)


def _return_memory() -> None:
    """Give back to the system what a diagnosis leaves: cycles of large arrays, and fragments.

    A worker lives for thousands of them; these added a quarter to its memory within 80. Looking for
    cycles takes 0.1 s, so only now and then. Fragments: with glibc.
    """
    if next(_DONE) % _BETWEEN_COLLECTIONS == 0:
        gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def _kept(folder: Folder, name: str) -> Row:
    """The row of an existing file.

    Raises:
        ValueError: it is damaged.
    """
    (row,) = from_parquet(folder.read([name])[name], RESULT)
    return row


def _row(job: Job, path: Path) -> Row:
    try:
        return _diagnosis(job, path)
    except (UnusableInput, ConfigError) as error:
        reason = "; ".join(str(error).splitlines()).replace(str(path), job.url)
        lists: Row = {"channels": [], "gap": [], "causes": [], "friction": []}
        return {"verdict": REFUSED, "reason": reason.removeprefix(f"{job.url}: "), **lists}


def _diagnosis(job: Job, path: Path) -> Row:
    from sim2real.gap import combined_floors
    from stagectl.config import parse_machine
    from stagectl.diagnosis import diagnose_recordings, machine_of
    from stagectl.store import read_recording

    recording = replace(read_recording(path), source=job.url)
    if job.machine is None:
        machine = machine_of(None, recording, fitted=True)
    else:
        machine = parse_machine(*job.machine, fitted=True)
    report = diagnose_recordings([recording], machine, correct=job.correct).found.report
    return {
        "stage": machine.name,
        "started": _time(recording.started),
        "verdict": report.verdict,
        "reason": report.reason,
        "floors": combined_floors(report.gap) if report.gap else None,
        "gap_closed": report.gap_closed,
        "channels": [finding.text for finding in report.channels],
        **_lists(report),
        **_notes(path, machine),
        "machine": machine.text,
        "report": json.dumps(report.to_json(), allow_nan=False),
    }


def _lists(report: GapReport) -> Row:
    return {
        "gap": [
            {"axis": axis, "signal": signal, "gap": of.nominal, "floor": of.floor, "unit": of.unit}
            for axis, signals in (report.gap or {}).items() for signal, of in signals.items()
        ],
        "causes": [
            {"axis": c.axis, "effect": c.effect, "probability": c.probability,
             "gap_closed": c.gap_closed, "remedy": c.remedy}
            for c in report.causes
        ],
    }  # fmt: skip


def _notes(path: Path, machine: Machine) -> Row:
    """What the run noted of itself and of friction; other programs' recordings have no notes."""
    from stagectl.history import runs_in

    try:
        (run,) = runs_in(path)
    except UnusableInput:
        return {"friction": []}
    friction: dict[str, Any] = {}
    for estimate in run.estimates:
        if estimate.accepted and "coulomb" in estimate.figures and estimate.axis in machine.axes:
            friction[estimate.axis] = {
                "axis": estimate.axis,
                "coulomb": estimate.figures["coulomb"],
                "sigma": estimate.sigma("coulomb"),
            }
    return {
        "simulated": run.entry.stage.simulated, "recipe": run.entry.recipe, "lot": run.entry.lot,
        "friction": list(friction.values()),
    }  # fmt: skip


def _time(text: str) -> datetime | None:
    """An ISO 8601 time with zone; None for any other text."""
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        return None
    return None if when.tzinfo is None else when.astimezone(UTC)
