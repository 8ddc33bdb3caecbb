"""What is known of each recording of a fleet: which result it has, or why it has none."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from stagectl.errors import UnusableInput
from stagectl.fleet.rows import (
    ENTRY,
    REFUSED,
    RESULT,
    WHOLE_ONLY,
    Row,
    from_parquet,
    kept_rows,
    to_parquet,
)
from stagectl.fleet.storage import Folder
from stagectl.fleet.task import RESULTS, Done, Job

FILE = "recordings.parquet"
_EVERY = 10.0
"""Shortest time between two saves [s]; a save that is lost costs reading recordings again, no
diagnosis."""
_SHARE = 0.02
"""Largest share of the time that goes into saving."""
_AT_ONCE = 500
"""Results that are read at once."""


class Ledger:
    """The table of recordings in a folder of results.

    Args:
        folder: with or without results.

    Raises:
        UnusableInput: the table is damaged.
    """

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        rows = kept_rows(folder, FILE, ENTRY)
        self._entries = {str(row["recording"]): row for row in rows}
        self._saved = time.monotonic()
        self._pause = _EVERY

    def split(self, jobs: Sequence[Job]) -> tuple[list[Job], list[Done]]:
        """Jobs to do; and those done before, of recordings that have not changed since."""
        existing = self._folder.names(RESULTS)
        todo, done = [], []
        for job in jobs:
            entry = self._entries.get(job.url)
            same = entry is not None and job.stamp and entry["stamp"] == job.stamp
            known = entry if same and entry is not None and entry["content"] else None
            if known is not None and (name := job.result(known["content"])) in existing:
                refusal = known["refusal"]
                done.append(Done(job.url, job.stamp, known["content"], name, True, refusal))
            else:
                todo.append(job)
        return todo, done

    def note(self, done: Done) -> None:
        """A recording has a result."""
        self._put(
            done.url, stamp=done.stamp, content=done.content, result=done.result,
            refusal=done.refusal,
        )  # fmt: skip

    def adopt(self, jobs: Sequence[Job]) -> None:
        """Note results of these jobs whose answer has not come: this client was stopped before."""
        of_url = {job.url: job for job in jobs}
        known = {str(entry["result"]) for entry in self._entries.values()}
        for name in sorted(self._folder.names(RESULTS) - known):
            try:
                (row,) = from_parquet(self._folder.read([name])[name], RESULT, WHOLE_ONLY)
            except (ValueError, KeyError):
                continue  # another's, or being replaced
            job = of_url.get(str(row["recording"]))
            if job is not None and job.result(str(row["content"])) == name:
                refusal = row["reason"] if row["verdict"] == REFUSED else None
                self.note(Done(job.url, job.stamp, row["content"], name, False, refusal))

    def note_failure(self, url: str, reason: str) -> None:
        """A recording has none; it is tried again next time."""
        self._put(url, failure=reason)

    def _put(self, url: str, **values: str | None) -> None:
        self._entries[url] = {**dict.fromkeys(ENTRY.names), "recording": url, **values}
        if time.monotonic() > self._saved + self._pause:
            self.save()

    def save(self) -> None:
        """Write the table.

        Raises:
            StagectlError: it cannot be written.
        """
        begun = time.monotonic()
        rows = [self._entries[url] for url in sorted(self._entries)]
        self._folder.write(FILE, to_parquet(rows, ENTRY))
        self._saved = time.monotonic()
        self._pause = max(_EVERY, (self._saved - begun) / _SHARE)

    def failures(self) -> dict[str, str]:
        """Recordings without a result -> why."""
        return {
            url: str(entry["failure"]) for url, entry in self._entries.items()
            if entry["failure"] is not None
        }  # fmt: skip

    def rows(self) -> Iterator[Row]:
        """The results, each with the recording that it is of; without their reports.

        Raises:
            UnusableInput: a result is missing or damaged.
        """
        named = [(u, str(e["result"])) for u, e in self._entries.items() if e["result"]]
        for first in range(0, len(named), _AT_ONCE):
            part = named[first : first + _AT_ONCE]
            contents = self._folder.read(dict.fromkeys(name for _, name in part))
            for url, name in part:
                if name not in contents:
                    raise UnusableInput(
                        f"{self._folder.address}/{name}: missing; 'fleet diagnose' makes it again"
                    )
                try:
                    (row,) = from_parquet(contents[name], RESULT, WHOLE_ONLY)
                except ValueError as error:
                    raise UnusableInput(
                        f"{self._folder.address}/{name}: damaged: {error}; remove it, and 'fleet "
                        "diagnose' makes it again"
                    ) from error
                yield row | {"recording": url}
