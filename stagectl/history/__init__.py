"""The friction history: every estimate with time and place, in SQLite or PostgreSQL.

`port` (what the program sees), `records` (rows), `address` and `opening` (which history), `sql` on
`database` or `postgres`, `writer` (a thread), `notes` and `filing` (from recordings), `measured`
(levels).
"""

from stagectl.config.history_address import is_server, without_password
from stagectl.history.filing import file_run, file_unfiled_runs, runs_in
from stagectl.history.measured import measured_level, misfit_error
from stagectl.history.notes import note_of_estimate, note_of_run, step_record
from stagectl.history.opening import FILE_NAME, default_history, open_existing, open_history
from stagectl.history.port import History
from stagectl.history.records import (
    F64,
    Activation,
    EstimateRecord,
    Measurement,
    Pair,
    RunEntry,
    StageKey,
    StepRecord,
    Trend,
    Wear,
)
from stagectl.history.temperature import (
    LatestTemperature,
    Thermometer,
    plugin_thermometer,
    stage_temperature,
)
from stagectl.history.writer import HistoryWriter

__all__ = [
    "F64",
    "FILE_NAME",
    "Activation",
    "EstimateRecord",
    "History",
    "HistoryWriter",
    "LatestTemperature",
    "Measurement",
    "Pair",
    "RunEntry",
    "StageKey",
    "StepRecord",
    "Thermometer",
    "Trend",
    "Wear",
    "default_history",
    "file_run",
    "file_unfiled_runs",
    "is_server",
    "measured_level",
    "misfit_error",
    "note_of_estimate",
    "note_of_run",
    "open_existing",
    "open_history",
    "plugin_thermometer",
    "runs_in",
    "stage_temperature",
    "step_record",
    "without_password",
]
