from .compensation.all_axes import make_compensation
from .compensation.axis_compensation import TAKE_OVER, AxisCompensation
from .compensation.mode import Figures, Mode
from .compensation.observed_offsets import ObservedOffsets
from .compensation.places import Expectation, FreshPlaces, Places
from .engine import Engine
from .events import (
    Event,
    Exposed,
    FrictionUpdated,
    LevelStepped,
    Limitation,
    MarkFound,
    MarkNotFound,
    MoveStarted,
    ObserverFound,
    Retrying,
    SegmentDone,
    Settled,
    StopNoticed,
    Stopping,
    Waiting,
)
from .mover import MovingAxis
from .settling import (
    RESOLUTION,
    WINDOWS,
    MoveResult,
    MoveStatistics,
    SiteVerdict,
    arrival,
    judge,
    statistics,
    summarise_moves,
)

__all__ = [
    "RESOLUTION",
    "TAKE_OVER",
    "WINDOWS",
    "AxisCompensation",
    "Engine",
    "Event",
    "Expectation",
    "Exposed",
    "Figures",
    "FreshPlaces",
    "FrictionUpdated",
    "LevelStepped",
    "Limitation",
    "MarkFound",
    "MarkNotFound",
    "Mode",
    "MoveResult",
    "MoveStarted",
    "MoveStatistics",
    "MovingAxis",
    "ObservedOffsets",
    "ObserverFound",
    "Places",
    "Retrying",
    "SegmentDone",
    "Settled",
    "SiteVerdict",
    "StopNoticed",
    "Stopping",
    "Waiting",
    "arrival",
    "judge",
    "make_compensation",
    "statistics",
    "summarise_moves",
]
