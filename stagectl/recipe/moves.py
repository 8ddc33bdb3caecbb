"""The list of moves of a recipe: complete profiles, and positions within the travel."""

from __future__ import annotations

from stagectl.config.parsing.validation import suggest
from stagectl.recipe import schema
from stagectl.recipe.checks import Check, Location, why_outside
from stagectl.recipe.model import (
    MAX_STEPS,
    Excite,
    Move,
    Repeat,
    Reverse,
    To,
    count_unrolled,
)
from stagectl.recipe.plan import MoveStep, walk
from stagectl.recipe.schema import Dwell, Profile

MOST_BAND = 0.25
"""Highest frequency of an excitation over that of SYNC: straight lines join the setpoints."""
LEAST_PERIODS = 4
"""Fewest periods of an excitation's lowest frequency."""


def read_moves(
    check: Check, items: list[schema.MoveItem], macro: Profile, micro: Profile, at: Location
) -> tuple[Move, ...]:
    """The list of moves with complete profiles, checked against the limits."""
    moves: list[Move] = []
    for index, item in enumerate(items):
        here = (*at, index)
        match item:
            case Dwell():
                moves.append(item)
            case schema.ExciteItem():
                excite = _read_excite(check, item, micro, here)
                moves.append(excite or Dwell(0.0))  # a placeholder, as below
            case schema.RepeatItem():
                inner = read_moves(check, item.moves, macro, micro, (*here, "moves"))
                moves.append(Repeat(item.repeat, inner))
            case schema.ToItem():
                moves.append(To(item.to, item.kind, _read_motion(check, item, macro, micro, here)))
            case schema.ReverseItem():
                if (axis := _read_axis(check, item.axis, (*here, "axis"))) is None:
                    moves.append(Dwell(0.0))  # a placeholder keeps the indices of the others
                    continue
                profile = _read_motion(check, item, macro, micro, here, axis)
                moves.append(Reverse(item.reverse, axis, item.kind, profile))
    return tuple(moves)


def check_path(check: Check, moves: tuple[Move, ...]) -> None:
    """Check that every position is within the travel, starting from home."""
    if (total := count_unrolled(moves)) > MAX_STEPS:
        check.refuse(("moves",), f"unrolls to {total} moves and dwells, more than {MAX_STEPS}")
        return
    seen: set[tuple[Location, int]] = set()
    for location, position, step in walk(moves, (0.0, 0.0)):
        if isinstance(step, Excite):
            k, reach = step.axis, step.amplitude
            name, axis = check.axes[k]
            reason = why_outside(position[k], -reach, reach, axis.travel, "excitation")
            if reason and (location, k) not in seen:
                seen.add((location, k))
                check.refuse((*location, "amplitude"), f"{reason} of axis {name}")
            continue
        for k, (name, axis) in enumerate(check.axes):
            reason = why_outside(position[k], 0.0, 0.0, axis.travel)
            if reason and isinstance(step, MoveStep) and (location, k) not in seen:
                if step.relative is not None and step.relative[k] == 0:
                    continue  # it was outside already, by a move that is reported
                seen.add((location, k))
                key = "to" if step.relative is None else "reverse"
                check.refuse((*location, key), f"{reason} of axis {name}")


def _read_axis(check: Check, axis: str, at: Location) -> int | None:
    """The number of an axis; None where the machine has none of that name."""
    names = list(check.machine.axes)
    if axis in names:
        return names.index(axis)
    check.refuse(at, f"no such axis in the machine{suggest(axis, names)}")
    return None


def _read_excite(
    check: Check, item: schema.ExciteItem, micro: Profile, at: Location
) -> Excite | None:
    """An excitation, its band below what the SYNC can carry; None where it has problems."""
    if (axis := _read_axis(check, item.excite, (*at, "excite"))) is None:
        return None
    low, high = item.band
    most = MOST_BAND / check.machine.bus.sync_period
    if not low < high:
        check.refuse((*at, "band"), f"must be [lowest, highest], is [{low:g}, {high:g}] Hz")
    elif high > most:
        check.refuse((*at, "band"), f"{high:g} Hz is above {most:g} Hz, a quarter of the SYNC's")
    elif item.duration * low < LEAST_PERIODS:
        check.refuse((*at, "duration"), f"is shorter than {LEAST_PERIODS} periods of {low:g} Hz")
    profile = _read_motion(check, item, micro, micro, at, axis)
    return Excite(axis, item.shape, item.amplitude, (low, high), item.duration, profile)


def _read_motion(
    check: Check,
    item: schema.ToItem | schema.ReverseItem | schema.ExciteItem,
    macro: Profile,
    micro: Profile,
    at: Location,
    only: int | None = None,
) -> Profile:
    """The profile of a move: its own limits, else its kind's; a creep needs a velocity."""
    kind = "other" if isinstance(item, schema.ExciteItem) else item.kind
    base = macro if kind == "macro" else micro
    if kind == "creep" and item.velocity is None:
        check.refuse((*at, "velocity"), "is missing: a creep needs a velocity of its own")
    profile = Profile(
        item.velocity or base.velocity,
        item.acceleration or base.acceleration,
        item.jerk or base.jerk,
    )
    if profile != base:
        check.check_limits(profile, at, only)
    return profile
