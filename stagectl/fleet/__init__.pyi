from .history import keep_friction
from .ledger import Ledger
from .schedule import Outcome, cluster_at, local_cluster, outcomes
from .storage import Folder, Source, find_recordings
from .summary import Summary, summarise
from .task import Done, Job

__all__ = [
    "Done",
    "Folder",
    "Job",
    "Ledger",
    "Outcome",
    "Source",
    "Summary",
    "cluster_at",
    "find_recordings",
    "keep_friction",
    "local_cluster",
    "outcomes",
    "summarise",
]
