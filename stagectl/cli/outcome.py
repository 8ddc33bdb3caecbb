"""What is printed at the end of a run: all that its page says, and where the files are."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.console import RenderableType
from rich.text import Text

from stagectl.report import print_outline, run_outline, whole
from stagectl.run import RunResult
from stagectl.store import SPOOL_NAME


def render_outcome(result: RunResult, folder: Path) -> RenderableType:
    """What the run says, and its files."""
    outline = run_outline(
        result.summary,
        result.recording,
        notices=result.notices,
        first_update=result.first_update,
    )
    files = sorted(p.name for p in folder.iterdir()) if folder.is_dir() else []
    parts: list[RenderableType] = [Text(f"files in {folder}: {', '.join(files)}")]
    if SPOOL_NAME in files:
        text = (
            f"the bus log is incomplete (disk full?); its frames are in {SPOOL_NAME}, and "
            f"'stagectl recover {shlex.quote(str(folder))}' turns them into a log"
        )
        parts.append(whole(text, "yellow"))
    return print_outline(outline, *parts)
