"""One run, from a recipe to its files: session, record, resume, retries, replay."""

from stagectl.run.request import Resumed, RunRequest, RunResult
from stagectl.run.resume import load_interrupted
from stagectl.run.run_history import RunHistory, begins, software
from stagectl.run.session import Listener, execute

__all__ = [
    "Listener",
    "Resumed",
    "RunHistory",
    "RunRequest",
    "RunResult",
    "begins",
    "execute",
    "load_interrupted",
    "software",
]
