"""What a calibration's recording says: the sites it was to visit, and its estimates so far."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stagectl.errors import UnusableInput
from stagectl.recipe import Pair
from stagectl.store import RECORDING_NAME, RunNotes, read_notes


@dataclass(frozen=True, slots=True)
class RecordedCalibration:
    """A calibration, complete or interrupted.

    Attributes:
        sites: in the order of the visit, including the repeated first one at the end [m].
        friction: estimates so far, those of the calibration it resumed included, as entries of a
            summary.
    """

    sites: tuple[Pair, ...]
    friction: tuple[dict[str, Any], ...]


def read_calibration(path: Path) -> RecordedCalibration:
    """Read the recording of a calibration.

    Raises:
        UnusableInput: the run was not a calibration, or is of an older version.
    """
    notes = read_notes(path)
    run = next((e for e in notes.events if e.get("event") == "run"), None)
    if run is None or not run.get("sites"):
        raise UnusableInput(f"{path}: not a calibration, or one of an older version")
    try:
        sites = tuple((float(x), float(y)) for x, y in run["sites"])
        before: tuple[dict[str, Any], ...] = ()
        if run["resumed"] is not None:
            earlier = Path(str(run["resumed"]["run"]))
            if (earlier / RECORDING_NAME).exists():  # it may have been deleted
                before = read_calibration(earlier / RECORDING_NAME).friction
        return RecordedCalibration(sites, (*before, *_friction(notes)))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UnusableInput(f"{path}: /events: damaged ({type(error).__name__}: {error})") from None


def _friction(notes: RunNotes) -> list[dict[str, Any]]:
    return [
        {
            "site": event["site"], "axis": event["axis"], "accepted": event["accepted"],
            "reason": event["reason"],
            "parameters": {
                name: {"value": float(pair[0]), "sigma": float(pair[1])}
                for name, pair in event["parameters"].items()
            },
        }
        for event in notes.events
        if event["event"] == "friction"
    ]  # fmt: skip
