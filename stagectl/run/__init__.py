"""One run, from a recipe to its files.

`checks` (whether it can begin), `prepare`, `session` (the order of things), `record` (its files),
`run_history` (its estimates), `summarise` and `documents` (from the recording), `retries` (after a
fault), `resume` (an interrupted run), `listing`, `replay` (a run again, on its bus log).

Names are imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stagectl.on_first_use import on_first_use

if TYPE_CHECKING:
    from stagectl.run.checks import Checked, Substitutes, check, start_time
    from stagectl.run.documents import document_paths, is_calibration, rewrite_documents
    from stagectl.run.listing import ListedRun, list_runs
    from stagectl.run.request import Resumed, RunRequest, RunResult
    from stagectl.run.resume import load_interrupted
    from stagectl.run.run_history import RunHistory, software_version
    from stagectl.run.session import Listener, execute

__all__ = [
    "Checked",
    "ListedRun",
    "Listener",
    "Resumed",
    "RunHistory",
    "RunRequest",
    "RunResult",
    "Substitutes",
    "check",
    "document_paths",
    "execute",
    "is_calibration",
    "list_runs",
    "load_interrupted",
    "rewrite_documents",
    "software_version",
    "start_time",
]

__getattr__ = on_first_use(
    __name__,
    {
        "documents": ("document_paths", "is_calibration", "rewrite_documents"),
        "listing": ("ListedRun", "list_runs"),
        "checks": ("Checked", "Substitutes", "check", "start_time"),
        "request": ("Resumed", "RunRequest", "RunResult"),
        "resume": ("load_interrupted",),
        "run_history": ("RunHistory", "software_version"),
        "session": ("Listener", "execute"),
    },
)
