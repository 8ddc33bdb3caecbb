"""Recordings on disk: HDF5, docs/formats/recording.md version 1; samples: `recording_blocks`.

Files of other programs can be read as well: every value is checked, unknown groups and attributes
are ignored, and an error is one line that names file, dataset and sample. Writing is atomic: the
file appears under its name complete or not at all.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from stagectl.errors import StagectlError, UnusableInput
from stagectl.plain_text import one_line
from stagectl.store import hdf5
from stagectl.store.atomic import write_atomically
from stagectl.store.cycle_ledger import CycleLedger
from stagedata import F64, Recording

FORMAT = "stagectl-recording"
VERSION = 1
MAX_MOVES = 1_000_000
NO_SITE = 0  # in `/moves`; sites count from 1

SIGNALS = (
    ("position_demand", "m"),
    ("force_offset", "N"),
    ("position_actual", "m"),
    ("force_actual", "N"),
)
_COMPRESSION: dict[str, object] = {"compression": "gzip", "compression_opts": 4, "shuffle": True}


def read_ledger(path: Path | str) -> CycleLedger | None:
    """Read the cycle ledger of a recording.

    Args:
        path: the HDF5 file.

    Returns:
        The ledger; None where the recording has none in our format.

    Raises:
        UnusableInput: as `recording_blocks.read_recording`.
    """
    with hdf5.open_hdf5(path) as file:
        check_format(file)
        if "cycle/late" not in file or "cycle/arrival" not in file:
            return None
        late = hdf5.read_integers(file, "cycle/late", len(hdf5.read_floats(file, "time")))
        group = hdf5.open_group(file, "cycle/arrival")
        axes = list(hdf5.member_names(hdf5.open_group(file, "axes")))
        return CycleLedger(
            arrival={
                name: hdf5.read_floats(group, name, len(late), finite=False)  # nan where missed
                for name in axes
            },
            late=late.astype(np.bool_),
            sync=_optional(file, "cycle/sync", len(late)),
            doubt=_optional(file, "cycle/doubt", len(late)),
            extra={
                name: hdf5.read_integers(file, f"cycle/extra/{name}", len(late)).astype(np.uint8)
                for name in (axes if len(file.get("cycle/extra", ())) else ())  # all or none
            },
        )


def _optional(file: h5py.File, name: str, count: int) -> F64 | None:
    """A dataset of the ledger that may be absent, with nan where unknown."""
    return hdf5.read_floats(file, name, count, finite=False) if name in file else None


@dataclass(frozen=True, slots=True)
class RunNotes:
    """What a run recorded besides its samples.

    Attributes:
        recipe: text of the recipe, or "".
        machine: text of the machine file.
        started: ISO 8601 time with zone.
        outcome: how it ended, or "" if the recording does not say.
        events: in order, each with its name `event` and the index `sample` of the next sample.
        fault: its text, or None.
    """

    recipe: str
    machine: str
    started: str
    outcome: str
    events: tuple[Mapping[str, Any], ...]
    fault: str | None = None

    def all(self, event: str) -> list[Mapping[str, Any]]:
        """All events of a name, in order."""
        return [each for each in self.events if each["event"] == event]

    def last(self, event: str) -> Mapping[str, Any]:
        """The last event of a name; empty where there is none."""
        return next(reversed(self.all(event)), {})


@contextmanager
def reading_events(path: Path) -> Iterator[None]:
    """For the block that reads the events of a recording.

    Raises:
        UnusableInput: they are not as written.
    """
    try:
        yield
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = one_line(f"{type(error).__name__}: {error}", 200)
        raise UnusableInput(f"{path}: /events: damaged ({reason})") from None


def read_notes(path: Path | str) -> RunNotes:
    """Read the notes of a run without its samples.

    Raises:
        UnusableInput: as `recording_blocks.read_recording`, or an event is no object with a name.
    """
    with hdf5.open_hdf5(path) as file:
        check_format(file)
        events = []
        if "events" in file:
            for number, text in enumerate(hdf5.read_array(file, "events", "OS", MAX_MOVES)):
                try:
                    event = json.loads(text)
                except (ValueError, TypeError, RecursionError):
                    event = None
                if not isinstance(event, dict) or "event" not in event:
                    raise UnusableInput(f"/events: entry {number}: not a JSON object with a name")
                events.append(event)
        return RunNotes(
            recipe=hdf5.read_text(file, "recipe", default=""),
            machine=hdf5.read_text(file, "machine"),
            started=hdf5.read_line(file, "started", default=""),
            outcome=hdf5.read_line(file, "outcome", default=""),
            events=tuple(events),
            fault=one_line(hdf5.read_text(file, "fault", default=""), 4000) or None,
        )


def write_recording(
    recording: Recording,
    path: Path | str,
    ledger: CycleLedger | None = None,
    notes: RunNotes | None = None,
) -> None:
    """Write a recording atomically.

    Args:
        recording: to write.
        path: of the HDF5 file, replacing an existing one.
        ledger: of the same K cycles, for `/cycle`.
        notes: of the run: events for `/events`, one JSON text each; outcome and fault.

    Raises:
        StagectlError: the file cannot be written.
    """
    path = Path(path)
    # In memory first: on a full disk, closing an HDF5 file can crash the process.
    image = io.BytesIO()
    try:
        with h5py.File(image, "w") as file:
            _write(file, recording, ledger)
            if notes is not None:
                _write_notes(file, notes)
    except OSError as error:
        raise StagectlError(
            f"{path}: cannot write the recording: {hdf5.reason_of(error)}"
        ) from error
    write_atomically(path, image.getbuffer(), "recording", durable=True)


def _write(file: h5py.File, recording: Recording, ledger: CycleLedger | None) -> None:
    file.attrs.update(
        format=FORMAT,
        version=VERSION,
        machine=recording.machine,
        recipe=recording.recipe,
        started=recording.started,
    )
    _dataset(file, "time", recording.time, "s")
    axes = file.create_group("axes", track_order=True)  # the machine's order, not the alphabet's
    for name, signals in recording.axes.items():
        group = axes.create_group(name)
        for signal, unit in SIGNALS:
            _dataset(group, signal, getattr(signals, signal), unit)
            if signal in signals.missing:
                group[signal].attrs["logged"] = 0
        if signals.statusword is not None:
            _dataset(group, "statusword", signals.statusword.astype(np.uint16), "1")
        _dataset(group, "valid", signals.valid.astype(np.uint8), "1")
    _dataset(file, "moves", _move_table(recording), "m")
    file["moves"].attrs["columns"] = "from_*, to_* in m; start, end in samples; site from 1, 0 none"
    if ledger is not None:
        cycle = file.create_group("cycle")
        _dataset(cycle, "late", ledger.late.astype(np.uint8), "1")
        _dataset(cycle, "missed", ledger.missed_per_cycle, "1")
        _dataset(cycle, "tardy", ledger.tardy_per_cycle, "1")
        _dataset(cycle, "doubled", ledger.doubled_per_cycle, "1")
        extra = cycle.create_group("extra", track_order=True)
        for name, counts in ledger.extra.items():
            _dataset(extra, name, counts, "1")
        arrival = cycle.create_group("arrival", track_order=True)
        for name, values in ledger.arrival.items():
            _dataset(arrival, name, values, "s")
        for name, seconds in (("sync", ledger.sync), ("doubt", ledger.doubt)):
            if seconds is not None:
                _dataset(cycle, name, seconds, "s")


def _write_notes(file: h5py.File, notes: RunNotes) -> None:
    if notes.events:
        texts = [json.dumps(event) for event in notes.events]
        file.create_dataset("events", data=texts, dtype=h5py.string_dtype())
        file["events"].attrs["unit"] = "1"
    file.attrs["outcome"] = notes.outcome
    if notes.fault is not None:
        file.attrs["fault"] = notes.fault


def _dataset(group: h5py.Group, name: str, values: npt.NDArray[Any], unit: str) -> None:
    options = _COMPRESSION if len(values) else {}
    group.create_dataset(name, data=values, **options).attrs["unit"] = unit


def _move_table(recording: Recording) -> npt.NDArray[np.void]:
    names = tuple(recording.axes)
    columns = [("kind", "S8"), ("site", "<i8"), ("start", "<i8"), ("end", "<i8")]
    columns += [(f"from_{name}", "<f8") for name in names]
    columns += [(f"to_{name}", "<f8") for name in names]
    rows = [
        (
            move.kind.encode("ascii"),
            NO_SITE if move.site is None else move.site,
            move.start,
            move.end,
            *(move.origin[name] for name in names),
            *(move.target[name] for name in names),
        )
        for move in recording.moves
    ]
    return np.array(rows, dtype=np.dtype(columns))


def check_format(file: h5py.File) -> None:
    """Refuse a file that is not a recording, or one of a newer version."""
    if hdf5.read_line(file, "format", default="") != FORMAT:
        raise UnusableInput(f"attribute format: not {FORMAT!r}: not a stagectl recording")
    version = file.attrs.get("version")
    if not isinstance(version, int | np.integer) or version < 1:
        raise UnusableInput(f"attribute version: must be a whole number from 1, is {version!r}")
    if version > VERSION:
        raise UnusableInput(
            f"attribute version: {version} is newer than this program reads ({VERSION})"
        )
