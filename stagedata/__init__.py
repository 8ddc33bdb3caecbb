"""The data that the other packages exchange: samples, moves, recordings. No bus, no files.

What two packages share and neither owns lives here, as frozen dataclasses in SI units. Everything
may import this package; it imports none of the others.
"""

from stagedata.recording import (
    MOVE_KINDS,
    AxisSignals,
    BoolArray,
    FloatArray,
    Move,
    Recording,
    StatusArray,
    aligned_demand,
)
from stagedata.samples import Samples

__all__ = [
    "MOVE_KINDS",
    "AxisSignals",
    "BoolArray",
    "FloatArray",
    "Move",
    "Recording",
    "Samples",
    "StatusArray",
    "aligned_demand",
]
