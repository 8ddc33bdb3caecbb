from .checks import Checked, Substitutes, check, stage_key, start_time
from .execution import execute, find_measurement
from .listener import Listener
from .recorded.documents import document_paths, is_calibration, rewrite_documents
from .recorded.listing import ListedRun, list_runs
from .recorded.resume import load_interrupted, recorded_measurement
from .request import HostSettings, Remarks, Resumed, RunRequest, RunResult, SimulatedStage
from .run_history import RunHistory, software_version

__all__ = [
    "Checked",
    "HostSettings",
    "ListedRun",
    "Listener",
    "Remarks",
    "Resumed",
    "RunHistory",
    "RunRequest",
    "RunResult",
    "SimulatedStage",
    "Substitutes",
    "check",
    "document_paths",
    "execute",
    "find_measurement",
    "is_calibration",
    "list_runs",
    "load_interrupted",
    "recorded_measurement",
    "rewrite_documents",
    "software_version",
    "stage_key",
    "start_time",
]
