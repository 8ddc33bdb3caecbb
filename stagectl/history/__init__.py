"""Friction over time and place: what was estimated when, where, and what became of it."""

from stagectl.history.filing import file_left_behind, file_run, runs_in
from stagectl.history.measured import doubt, measured_level
from stagectl.history.noted import note_of_estimate, note_of_run, step_record
from stagectl.history.opening import (
    FILE_NAME,
    default_history,
    is_server,
    open_history,
    without_password,
)
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
    "doubt",
    "file_left_behind",
    "file_run",
    "is_server",
    "measured_level",
    "note_of_estimate",
    "note_of_run",
    "open_history",
    "plugin_thermometer",
    "runs_in",
    "stage_temperature",
    "step_record",
    "without_password",
]
