"""Small JSON files beside a machine file, which keep something of its axes from run to run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from stagectl.errors import UnusableInput
from stagectl.store.atomic import write_atomically

T = TypeVar("T")
VERSION = 1


class AxisNotes:
    """One such file.

    Args:
        source: the machine file.
        kind: of the file: what its name ends in, and what it says that it is.

    Attributes:
        path: of it; None where the machine file is no file.
    """

    def __init__(self, source: str, kind: str) -> None:
        file = Path(source)
        self._format = f"stagectl-{kind}"
        self.path = file.with_name(f"{file.stem}.{kind}.json") if file.is_file() else None

    def read(self, entry: Callable[[Any], T]) -> dict[str, T]:
        """What is kept of each axis, through `entry`; nothing where there is no file.

        Raises:
            UnusableInput: the file is damaged.
        """
        if self.path is None or not self.path.exists():
            return {}
        try:
            kept = json.loads(self.path.read_text(encoding="utf-8"))
            if (kept["format"], kept["version"]) != (self._format, VERSION):
                raise ValueError(f"is not {self._format}, version {VERSION}")
            return {name: entry(found) for name, found in kept["axes"].items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            why = f"{type(error).__name__}: {error}"
            raise UnusableInput(f"{self.path}: damaged ({why})") from None

    def add(self, entries: dict[str, dict[str, Any]]) -> None:
        """Keep these, by axis, in place of earlier ones, where there is a place for it.

        Raises:
            StagectlError: the file is damaged, or cannot be written.
        """
        if self.path is None:
            return
        axes = {**self.read(dict), **entries}
        content = {"format": self._format, "version": VERSION, "axes": axes}
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
        write_atomically(self.path, text, "note")
