"""The friction history: every estimate with time and place, in SQLite or PostgreSQL.

`port` (what the program sees), `records` (rows), `opening` (which history), `sql` on
`database` or `postgres`, `writer` (a thread), `notes` and `filing` (from recordings), `measured`
(levels).

Names are imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stagectl.on_first_use import on_first_use

if TYPE_CHECKING:
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
]

__getattr__ = on_first_use(
    __name__,
    {
        "filing": ("file_run", "file_unfiled_runs", "runs_in"),
        "measured": ("measured_level", "misfit_error"),
        "notes": ("note_of_estimate", "note_of_run", "step_record"),
        "opening": ("FILE_NAME", "default_history", "open_existing", "open_history"),
        "port": ("History",),
        "records": (
            "F64",
            "Activation",
            "EstimateRecord",
            "Measurement",
            "Pair",
            "RunEntry",
            "StageKey",
            "StepRecord",
            "Trend",
            "Wear",
        ),
        "temperature": (
            "LatestTemperature",
            "Thermometer",
            "plugin_thermometer",
            "stage_temperature",
        ),
        "writer": ("HistoryWriter",),
    },
)
