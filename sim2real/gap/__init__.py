"""The gap between a stage and its model: free-run simulation against a recording.

`replay` runs the recorded demands through the model's closed loop, `floor` estimates what noise and
friction wander alone would leave, `measure` computes the gap from both, and `location` finds the
conditions of motion that hold most of it. Nothing is fitted here.
"""

from sim2real.gap.floor import check_repeats, floor
from sim2real.gap.location import Located, locate
from sim2real.gap.measure import (
    NO_GAP_BELOW,
    Gap,
    Measured,
    closed,
    combined,
    compare_with,
    measure,
    pooled,
)
from sim2real.gap.replay import Replay, Signals, periods, prepare, residual, rms

__all__ = [
    "NO_GAP_BELOW",
    "Gap",
    "Located",
    "Measured",
    "Replay",
    "Signals",
    "check_repeats",
    "closed",
    "combined",
    "compare_with",
    "floor",
    "locate",
    "measure",
    "periods",
    "pooled",
    "prepare",
    "residual",
    "rms",
]
