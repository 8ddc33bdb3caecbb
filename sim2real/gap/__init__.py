"""The gap between a stage and its model: free-run simulation against a recording.

`replay` runs the recorded demands through the model's closed loop, `floor` estimates what noise and
friction wander alone would leave, `measure` computes the gap from both, and `location` finds the
conditions of motion that hold most of it. Nothing is fitted here.
"""

from sim2real.gap.floor import DRAWS, PERFECT_MODEL, Floor, RepeatCheck
from sim2real.gap.location import Located, locate_gap
from sim2real.gap.measure import (
    NO_GAP_BELOW,
    Gap,
    GapMeter,
    Measured,
    combined_floors,
    combined_gap,
    compare_with_model,
    gap_closed,
    measure_gap,
    pool_gaps,
)
from sim2real.gap.quantisation import coarse_steps, quantisation_step, stated_step
from sim2real.gap.replay import (
    Replay,
    Signals,
    prepare_replay,
    rms,
    run_by_model,
    subtract_signals,
)
from sim2real.gap.sync_grid import match_periods, number_periods

__all__ = [
    "DRAWS",
    "NO_GAP_BELOW",
    "PERFECT_MODEL",
    "Floor",
    "Gap",
    "GapMeter",
    "Located",
    "Measured",
    "RepeatCheck",
    "Replay",
    "Signals",
    "coarse_steps",
    "combined_floors",
    "combined_gap",
    "compare_with_model",
    "gap_closed",
    "locate_gap",
    "match_periods",
    "measure_gap",
    "number_periods",
    "pool_gaps",
    "prepare_replay",
    "quantisation_step",
    "rms",
    "run_by_model",
    "stated_step",
    "subtract_signals",
]
