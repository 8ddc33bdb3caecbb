"""The data that the other packages exchange: samples, moves, recordings, friction figures.

What two packages share and neither owns lives here, as frozen dataclasses in SI units. Everything
may import this package; it imports none of the others. `stagedata.compiled` is how all of them
compile their kernels.
"""

from stagedata.angular_units import angular_unit as angular_unit
from stagedata.friction import LAW_FIGURES as LAW_FIGURES
from stagedata.friction import MAX_ELEMENTS as MAX_ELEMENTS
from stagedata.friction import FrictionFigures as FrictionFigures
from stagedata.friction import LawName as LawName
from stagedata.recording import MOVE_KINDS as MOVE_KINDS
from stagedata.recording import AxisSignals as AxisSignals
from stagedata.recording import BoolArray as BoolArray
from stagedata.recording import FloatArray as FloatArray
from stagedata.recording import Move as Move
from stagedata.recording import Recording as Recording
from stagedata.recording import aligned_demand as aligned_demand
from stagedata.samples import F64 as F64
from stagedata.samples import Samples as Samples
