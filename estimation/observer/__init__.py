"""The settling observer: estimates an axis' disturbance force from its position at every SYNC.

`loop` (the axis in its drive, linear), `model` (what the observer assumes, with its Kalman gain),
`sensitivity` (of the whole loop), `measured` (its margins by a measured response), `design` (the
largest gain that is safe), `filter`, `kernel` and `observer` (what happens between two SYNCs),
`watch` (whether it feeds an oscillation), `feedforward_error` (what a whole move lacked),
`lacking_force` (its least squares), `learned_feedforward` (what moves have in common), `sticking`
(friction without presliding).
"""

from estimation.observer.design import AxisFigures, Design, design_observer
from estimation.observer.feedforward_error import (
    COUPLING,
    LEAD,
    MASS,
    Course,
    FeedforwardErrors,
)
from estimation.observer.learned_feedforward import LearnedFeedforward
from estimation.observer.loop import Carriage, DriveLoop, Mode
from estimation.observer.measured import MeasuredLoop
from estimation.observer.observer import BusUnits, Finding, Kind, StageObserver
from estimation.observer.sticking import sticks, without_presliding

__all__ = [
    "COUPLING",
    "LEAD",
    "MASS",
    "AxisFigures",
    "BusUnits",
    "Carriage",
    "Course",
    "Design",
    "DriveLoop",
    "FeedforwardErrors",
    "Finding",
    "Kind",
    "LearnedFeedforward",
    "MeasuredLoop",
    "Mode",
    "StageObserver",
    "design_observer",
    "sticks",
    "without_presliding",
]
