from .checks import Checked, Substitutes, check, start_time
from .documents import document_paths, is_calibration, rewrite_documents
from .execution import execute
from .listener import Listener
from .listing import ListedRun, list_runs
from .request import Resumed, RunRequest, RunResult
from .resume import load_interrupted
from .run_history import RunHistory, software_version

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
