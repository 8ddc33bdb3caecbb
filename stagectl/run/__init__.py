"""One run, from a recipe to its files.

`prepare` (all checks), `session` (the order of things), `record` (its files), `run_history` (its
estimates), `summarise` and `documents` (from the recording), `retries` (after a fault), `resume`
(an interrupted run), `listing`, `replay` (a run again, on its bus log).
"""

from stagectl.run.documents import document_paths, is_calibration, rewrite_documents
from stagectl.run.listing import ListedRun, list_runs
from stagectl.run.prepare import Substitutes, prepare
from stagectl.run.request import Resumed, RunRequest, RunResult
from stagectl.run.resume import load_interrupted
from stagectl.run.run_history import RunHistory, software_version, start_time
from stagectl.run.session import Listener, execute

__all__ = [
    "ListedRun",
    "Listener",
    "Resumed",
    "RunHistory",
    "RunRequest",
    "RunResult",
    "Substitutes",
    "document_paths",
    "execute",
    "is_calibration",
    "list_runs",
    "load_interrupted",
    "prepare",
    "rewrite_documents",
    "software_version",
    "start_time",
]
