"""The data that the other packages exchange: samples, moves, recordings, friction figures.

What two packages share and neither owns lives here, as frozen dataclasses in SI units. Everything
may import this package; it imports none of the others. `stagedata.compiled` is how all of them
compile their kernels.
"""

from stagedata.friction import LAW_FIGURES, MAX_ELEMENTS, FrictionFigures, LawName
from stagedata.recording import (
    MOVE_KINDS,
    AxisSignals,
    BoolArray,
    FloatArray,
    Move,
    Recording,
    aligned_demand,
)
from stagedata.samples import Samples

__all__ = [
    "LAW_FIGURES",
    "MAX_ELEMENTS",
    "MOVE_KINDS",
    "AxisSignals",
    "BoolArray",
    "FloatArray",
    "FrictionFigures",
    "LawName",
    "Move",
    "Recording",
    "Samples",
    "aligned_demand",
]
