"""The longest move and run: recipes beyond are refused before anything moves.

A mistaken unit (a velocity of 1e-12, an exposure of 1e9 s) would otherwise show hours later, or as
a trajectory that does not fit into memory. Durations here are lower bounds that need no trajectory;
`dry_run` computes exact ones.
"""

from __future__ import annotations

import math
from typing import Final

from stagectl.recipe.model import Excite, ListedMarks, Recipe
from stagectl.recipe.plan import ExposeStep, MoveStep, plan
from stagectl.recipe.schema import Dwell, NoMark, Profile, Settle, SimulatedMark

MAX_MOVE: Final = 3600.0
"""Longest move [s]: all its setpoints are computed at once. Nothing is waited for any longer."""
MAX_RUN: Final = 43_200.0
"""Longest run [s]: the capacity of a recording at 1 kHz."""
_PLUGIN_REACH: Final = 1e-4  # m; bound of a micro-move onto a plug-in's mark


def why_too_long(recipe: Recipe) -> str | None:
    """Why the recipe takes too long, or None."""
    reach = _reach(recipe)
    total = 0.0
    position = (0.0, 0.0)
    for step in plan(recipe, position):
        match step:
            case MoveStep():
                distance = reach
                if (end := step.end(position, None)) is not None:
                    distance = max(abs(e - p) for e, p in zip(end, position, strict=True))
                    position = end
                least = minimum_duration(distance, step.profile)
                if least > MAX_MOVE:
                    return (
                        f"a {step.kind}-move of {distance * 1e3:g} mm takes at least "
                        f"{least / 3600.0:.3g} h, the limit is {MAX_MOVE / 3600.0:g} h"
                    )
                total += least
            case Settle():
                total += step.hold
            case Excite():
                if step.duration > MAX_MOVE:
                    return f"an excitation takes {step.duration:g} s, the limit is {MAX_MOVE:g} s"
                total += step.duration
            case ExposeStep() | Dwell():
                total += step.duration
    if total > MAX_RUN:
        return f"takes at least {total / 3600.0:.3g} h, a recording holds {MAX_RUN / 3600.0:g} h"
    return None


def minimum_duration(distance: float, profile: Profile) -> float:
    """A lower bound of the time from rest to rest over `distance` [m], in s.

    The longest of the durations under one limit each: d/v, 2 sqrt(d/a), 4 (d/2j)^(1/3).
    """
    return max(
        distance / profile.velocity,
        2.0 * math.sqrt(distance / profile.acceleration),
        4.0 * math.cbrt(distance / 2.0 / profile.jerk),
    )


def _reach(recipe: Recipe) -> float:
    """Longest micro-move onto a mark, per axis [m]."""
    match recipe.fiducial:
        case SimulatedMark(reach):
            return reach
        case ListedMarks(offsets):
            return max((abs(d) for pair in offsets.values() for d in pair), default=0.0)
        case NoMark():
            return 0.0
        case _:
            return _PLUGIN_REACH
