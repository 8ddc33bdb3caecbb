"""One run, from a recipe to its files.

`prepare` (all checks), `session` (the order of things), `record` (its files), `run_history` (its
estimates), `retries` (after a fault), `resume` (an interrupted run), `replay` (a run again, on its
bus log).
"""

from stagectl.run.prepare import Substitutes, prepare
from stagectl.run.request import Resumed, RunRequest, RunResult
from stagectl.run.resume import load_interrupted
from stagectl.run.run_history import RunHistory, software_version, start_time
from stagectl.run.session import Listener, execute

__all__ = [
    "Listener",
    "Resumed",
    "RunHistory",
    "RunRequest",
    "RunResult",
    "Substitutes",
    "execute",
    "load_interrupted",
    "prepare",
    "software_version",
    "start_time",
]
