"""Runs a recipe on a stage.

`engine` (the steps of a plan), `mover` (one move), `compensation` (its force offsets),
`observed_offsets` (their correction from SYNC to SYNC), `following_error` (the host's watch),
`move_data` (samples to the estimator), `settling` and `verdict` (how the moves went).

Names are imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stagectl.on_first_use import on_first_use

if TYPE_CHECKING:
    from stagectl.sequencer.compensation import TAKE_OVER, AxisCompensation, make_compensation
    from stagectl.sequencer.engine import Engine
    from stagectl.sequencer.events import (
        DriveLimited,
        EffectLeft,
        Event,
        Exposed,
        FrictionUpdated,
        LevelStepped,
        MarkFound,
        MarkNotFound,
        MoveStarted,
        Retrying,
        SegmentDone,
        Settled,
        StopNoticed,
        Stopping,
        Waiting,
    )
    from stagectl.sequencer.fresh_places import FreshPlaces
    from stagectl.sequencer.mode import Figures, Mode
    from stagectl.sequencer.mover import MovingAxis
    from stagectl.sequencer.observed_offsets import ObservedOffsets
    from stagectl.sequencer.places import Expectation, Places
    from stagectl.sequencer.settling import (
        RESOLUTION,
        WINDOWS,
        MoveResult,
        MoveStatistics,
        arrival,
        statistics,
        summarise_moves,
    )
    from stagectl.sequencer.verdict import SiteVerdict, judge

__all__ = [
    "RESOLUTION",
    "TAKE_OVER",
    "WINDOWS",
    "AxisCompensation",
    "DriveLimited",
    "EffectLeft",
    "Engine",
    "Event",
    "Expectation",
    "Exposed",
    "Figures",
    "FreshPlaces",
    "FrictionUpdated",
    "LevelStepped",
    "MarkFound",
    "MarkNotFound",
    "Mode",
    "MoveResult",
    "MoveStarted",
    "MoveStatistics",
    "MovingAxis",
    "ObservedOffsets",
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

__getattr__ = on_first_use(
    __name__,
    {
        "compensation": ("TAKE_OVER", "AxisCompensation", "make_compensation"),
        "engine": ("Engine",),
        "events": (
            "DriveLimited",
            "EffectLeft",
            "Event",
            "Exposed",
            "FrictionUpdated",
            "LevelStepped",
            "MarkFound",
            "MarkNotFound",
            "MoveStarted",
            "Retrying",
            "SegmentDone",
            "Settled",
            "StopNoticed",
            "Stopping",
            "Waiting",
        ),
        "fresh_places": ("FreshPlaces",),
        "mode": ("Figures", "Mode"),
        "mover": ("MovingAxis",),
        "observed_offsets": ("ObservedOffsets",),
        "places": ("Expectation", "Places"),
        "settling": (
            "RESOLUTION",
            "WINDOWS",
            "MoveResult",
            "MoveStatistics",
            "arrival",
            "statistics",
            "summarise_moves",
        ),
        "verdict": ("SiteVerdict", "judge"),
    },
)
