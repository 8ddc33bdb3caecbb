"""The queue of recipes, on disk: a killed server comes back with it, and starts nothing."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from stagectl.errors import StagectlError, UnusableInput
from stagectl.protocol.message import Message
from stagectl.protocol.requests import QueueAdd
from stagectl.protocol.state import QueueEntry
from stagectl.protocol.wire import one_problem
from stagectl.store import write_atomically

FILE_NAME = "queue.json"
_VERSION = 1
_ENDED_KEPT = 100
"""Entries that have ended stay in the list for the operator, the newest ones."""


class Stored(Message):
    """An entry with all that it takes to run it."""

    entry: QueueEntry
    request: QueueAdd


class RunQueue:
    """The queue of one server.

    Args:
        folder: of the file.

    Attributes:
        runs: whether the next entry begins by itself.

    Raises:
        UnusableInput: the file is damaged, or another version's.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE_NAME
        self._stored: list[Stored] = []
        self._number = 0
        self.runs = False
        if self._path.exists():
            self._read()

    @property
    def entries(self) -> tuple[QueueEntry, ...]:
        """All entries: ended, running, waiting."""
        return tuple(stored.entry for stored in self._stored)

    def add(self, request: QueueAdd, recipe: str, lot: str | None, wafer: str | None) -> QueueEntry:
        """Put a checked recipe at the end."""
        self._number += 1
        entry = QueueEntry(
            id=self._number, recipe=recipe, source=request.source, lot=lot, wafer=wafer,
            operator=request.operator, comment=request.comment, status="waiting",
            folder=request.folder, added=time.time(),
            machine=None if request.machine is None else request.machine.source,
        )  # fmt: skip
        self._stored.append(Stored(entry=entry, request=request))
        self._write()
        return entry

    def find(self, number: int) -> QueueEntry | None:
        """An entry, or None."""
        return next((entry for entry in self.entries if entry.id == number), None)

    def next(self) -> Stored | None:
        """The first that waits, or None."""
        return next((each for each in self._stored if each.entry.status == "waiting"), None)

    def update(self, number: int, **changes: Any) -> QueueEntry:
        """Change an entry, also on disk."""
        for place, stored in enumerate(self._stored):
            if stored.entry.id == number:
                entry = stored.entry.model_copy(update=changes)
                self._stored[place] = stored.model_copy(update={"entry": entry})
                self._write()
                return entry
        raise StagectlError(f"queue: no entry {number}")

    def remove(self, number: int) -> None:
        """Take an entry off."""
        self._stored = [each for each in self._stored if each.entry.id != number]
        self._write()

    def reorder(self, number: int, place: int) -> None:
        """Put an entry that waits at another place among those that wait."""
        waiting = [each for each in self._stored if each.entry.status == "waiting"]
        others = [each for each in self._stored if each.entry.status != "waiting"]
        moved = next(each for each in waiting if each.entry.id == number)
        waiting.remove(moved)
        waiting.insert(min(place, len(waiting)), moved)
        self._stored = others + waiting
        self._write()

    def _write(self) -> None:
        ended = [each for each in self._stored if each.entry.status in ("done", "interrupted")]
        dropped = {each.entry.id for each in ended[:-_ENDED_KEPT]}
        self._stored = [each for each in self._stored if each.entry.id not in dropped]
        body = {
            "version": _VERSION,
            "number": self._number,
            "entries": [each.model_dump(mode="json") for each in self._stored],
        }
        write_atomically(self._path, json.dumps(body, indent=1) + "\n", "queue")

    def _read(self) -> None:
        try:
            body = json.loads(self._path.read_text(encoding="utf-8"))
            if body["version"] != _VERSION:
                raise UnusableInput(f"{self._path}: version {body['version']}, not {_VERSION}")
            self._stored = [Stored.model_validate_json(json.dumps(e)) for e in body["entries"]]
            self._number = int(body["number"])
        except ValidationError as why:
            raise UnusableInput(f"{self._path}: {one_problem(why)}") from why
        except (OSError, ValueError, KeyError, TypeError) as why:
            raise UnusableInput(f"{self._path}: is damaged: {why}") from why
