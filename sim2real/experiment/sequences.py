"""Candidate sequences of moves, each exciting something else, within what the recordings did."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil_sim.settings import StageSettings
from sim2real.experiment.strokes import stroke
from stagedata import F64

_CREEP = 0.06
"""Share of the highest speed for slow sweeps."""
_SHARES = (0.1, 0.4, 1.0)
"""Shares of the highest speed for strokes at several speeds."""
_MICRO = (10e-6, 30e-6, 90e-6)
"""Lengths of small reversals [m]."""
MICRO_LIMITS = {"velocity": 0.01, "acceleration": 0.2, "jerk": 20.0}
"""Velocity, acceleration and jerk of small reversals (SI)."""
_REST, _LONG_REST = 0.1, 3.0
"""Rest between moves, and between strokes meant to show what changes with time [s]."""
_DIGITS = 4
"""Decimals of targets [m]."""
Move = Mapping[str, Any]
"""As under `moves` of a recipe."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Range, speed and acceleration of an axis in the recordings, and so what the machine can do.

    Attributes:
        low, high: positions [m].
        speed, acceleration: largest demanded [m/s, m/s^2].
    """

    low: float
    high: float
    speed: float
    acceleration: float


def round_up(value: float) -> float:
    """Rounded up to ten thousandths."""
    return float(math.ceil(value * 1e4 - 1e-6) / 1e4)


def candidate_sequences(
    settings: StageSettings, axis: str, reach: Mapping[str, Reach]
) -> list[tuple[str, list[Move]]]:
    """Candidate sequences with their names, each a few seconds long.

    Args:
        settings: of the machine file.
        axis: that the question is about.
        reach: axis -> its reach.
    """
    own = reach[axis]
    names = [a.name for a in settings.axes]
    middle = {n: round(0.5 * (reach[n].low + reach[n].high), _DIGITS) for n in names}

    def to(target: float, which: str = axis, **more: Any) -> list[Move]:
        where = {**middle, which: target}
        return [{"to": [round(where[name], 6) for name in names], **more}, {"dwell": _REST}]

    def between(share: float) -> float:
        return round(own.low + share * (own.high - own.low), _DIGITS)

    def slow(share: float) -> float:
        return -round_up(-share * own.speed)

    long = [*to(own.high), *to(own.low)]
    speeds = [
        move
        for share in _SHARES
        for end in (own.high, own.low)
        for move in to(end, velocity=slow(share))
    ]
    sweep = [*to(own.high, velocity=slow(_CREEP)), *to(own.low, velocity=slow(_CREEP))]
    short = [move for i in range(8) for move in to(between(3 * i % 8 / 8))]
    small = []
    for share in (0.25, 0.5, 0.75):
        small += to(between(share))
        for size in (size * sign for size in _MICRO for sign in (1.0, -1.0)):
            small += to(between(share) + size, kind="micro")
    rests = [{"dwell": _LONG_REST}, *to(own.high), {"dwell": _LONG_REST}, *to(own.low)]
    found = [
        ("long strokes at full speed", long * 4),
        ("strokes at several speeds", speeds),
        ("a slow sweep there and back", sweep),
        ("short strokes at full acceleration", short),
        ("small reversals", small),
        ("strokes with long rests", rests * 2),
    ]
    found = [(name, [*to(own.low), *moves]) for name, moves in found]
    for name in names:
        if name != axis:
            low, high = reach[name].low, reach[name].high
            moves = [*to(low, name), *([*to(high, name), *to(low, name)] * 4)]
            found.append((f"strokes of {name} alone", moves))
    return found


def repeat_moves(
    moves: Sequence[Move], settings: StageSettings, macro: Mapping[str, float], shortest: float
) -> list[Move]:
    """The sequence, repeated after its approach until it takes long enough.

    Args:
        moves: of a candidate; the first two are its approach and the rest after it.
        settings: of the machine file.
        macro: as in a recipe.
        shortest: least duration [s].
    """
    repeated = list(moves)
    while len(setpoints(repeated, settings, macro)) * settings.sync_period < shortest:
        repeated += moves[2:]
    return repeated


def setpoints(moves: Sequence[Move], settings: StageSettings, macro: Mapping[str, float]) -> F64:
    """Setpoints of a sequence, float64[K, axes] [m]; `macro` as in a recipe."""
    period = settings.sync_period
    at = np.array(moves[0]["to"])
    parts = [np.tile(at, (round(_REST / period), 1))]
    for move in moves[1:]:
        if "dwell" in move:
            parts.append(np.tile(at, (round(move["dwell"] / period), 1)))
            continue
        to = np.array(move["to"])
        each = []
        for a in range(len(settings.axes)):
            limits = MICRO_LIMITS if move.get("kind") == "micro" else macro
            speed = move.get("velocity", limits["velocity"])
            each.append(
                stroke(to[a] - at[a], speed, limits["acceleration"], limits["jerk"], period)
            )
        length = max(len(values) for values in each)
        part = np.tile(to, (length, 1))
        for a, values in enumerate(each):
            part[: len(values), a] = at[a] + values
        parts.append(part)
        at = to
    return np.concatenate(parts)
