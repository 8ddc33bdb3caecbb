from .filing import (
    file_run,
    file_unfiled_runs,
    note_of_estimate,
    note_of_run,
    runs_in,
    step_record,
)
from .measured import measured_level, misfit_error
from .opening import FILE_NAME, default_history, existing_history, open_history
from .records import (
    Activation,
    AxisFriction,
    EstimateRecord,
    Measurement,
    Pair,
    RunEntry,
    RunFilter,
    RunFriction,
    StageKey,
    StepRecord,
    Trend,
    Wear,
)
from .sql import History
from .temperature import (
    LatestTemperature,
    Thermometer,
    plugin_thermometer,
    stage_temperature,
)
from .writer import HistoryWriter

__all__ = [
    "FILE_NAME",
    "Activation",
    "AxisFriction",
    "EstimateRecord",
    "History",
    "HistoryWriter",
    "LatestTemperature",
    "Measurement",
    "Pair",
    "RunEntry",
    "RunFilter",
    "RunFriction",
    "StageKey",
    "StepRecord",
    "Thermometer",
    "Trend",
    "Wear",
    "default_history",
    "existing_history",
    "file_run",
    "file_unfiled_runs",
    "measured_level",
    "misfit_error",
    "note_of_estimate",
    "note_of_run",
    "open_history",
    "plugin_thermometer",
    "runs_in",
    "stage_temperature",
    "step_record",
]
