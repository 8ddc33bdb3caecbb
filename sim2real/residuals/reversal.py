"""Force over position where the motion turns: the presliding branch of the friction loop.

The force is that of the motor less what accelerates the machine file's mass. All turns of one kind
are averaged over the distance to the farthest point, measured and simulated alike, each over its
own positions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sim2real.phases import Stroke
from sim2real.residuals.bins import Bins
from sim2real.residuals.course import MEASURED, Course
from stagedata import BoolArray, FloatArray

REACH = 100e-6
"""Distance from the turning point that is shown [m]."""
_SHORTEST = 10e-6
"""Strokes shorter than this say nothing of a turn [m]."""
_BINS = 14
_FEWEST = 3
"""Samples of a bin that counts."""
_CURVATURE = 3e-3
"""Time on either side of a sample from which its acceleration is taken [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """Mean force over position before the turn, or after it; n points.

    Attributes:
        place: position less the farthest one of the turn, float64[n] [m].
        force: motor force less mass times acceleration, float64[n] [N].
        spread: its standard deviation over samples, float64[n] [N].
    """

    place: FloatArray
    force: FloatArray
    spread: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ReversalLoop:
    """All turns of one kind, averaged.

    Attributes:
        direction: of the motion before the turn, +1 or -1.
        turns: how many were averaged.
        approach, departure: `MEASURED` or model -> force before the turn, and after it.
    """

    direction: int
    turns: int
    approach: Mapping[str, Branch]
    departure: Mapping[str, Branch]


def average_reversals(course: Course, mass: float) -> tuple[ReversalLoop, ...]:
    """Force over position around the turns of each kind; a kind without turns has none.

    Args:
        course: of the axis.
        mass: of the machine file [kg].
    """
    sources = {MEASURED: course.measured, **course.simulated}
    forces = {
        name: _without_inertia(signals, course, mass)
        for name, signals in sources.items()
        if "position" in signals
    }
    out = []
    for direction, turns in _turns(course).items():
        reaches = [_common(t.before.length for t in turns), _common(t.after.length for t in turns)]
        approach: dict[str, Branch] = {}
        departure: dict[str, Branch] = {}
        for name, force in forces.items():
            position = direction * sources[name]["position"]
            parts = [_part(position, force, course.valid, turn) for turn in turns]
            for side, branches in enumerate((approach, departure)):
                branch = _average([part[side] for part in parts], reaches[side], direction)
                if branch is not None:
                    branches[name] = branch
        if MEASURED in approach and MEASURED in departure:
            out.append(ReversalLoop(direction, len(turns), approach, departure))
    return tuple(out)


def _without_inertia(signals: Mapping[str, FloatArray], course: Course, mass: float) -> FloatArray:
    """Motor force less mass times acceleration, by the positions that belong to it [N]."""
    reach = max(1, round(_CURVATURE / course.period))
    position = np.pad(signals["position"], reach, mode="edge")
    bend = position[2 * reach :] - 2.0 * signals["position"] + position[: -2 * reach]
    return signals["force"] - mass * bend / (reach * course.period) ** 2


@dataclass(frozen=True, slots=True)
class _Turn:
    """Two strokes in opposite directions, and whether the first one is long."""

    before: Stroke
    after: Stroke
    is_full: bool


def _turns(course: Course) -> dict[int, list[_Turn]]:
    """Turns by the direction before them.

    Only turns after a stroke of at least `REACH`, where there are any: friction is fully developed
    there, while after a short stroke it also depends on earlier strokes.
    """
    found: dict[int, list[_Turn]] = {1: [], -1: []}
    for before, after in pairwise(course.strokes):
        recording = np.searchsorted(course.starts, [before.start, after.start], side="right")
        if before.direction != -after.direction or recording[0] != recording[1]:
            continue
        if min(before.length, after.length) >= _SHORTEST:
            found[before.direction].append(_Turn(before, after, before.length >= REACH))
    return {
        direction: [t for t in turns if t.is_full] or turns for direction, turns in found.items()
    }


def _part(
    position: FloatArray, force: FloatArray, valid: BoolArray, turn: _Turn
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Places and forces within reach of a turn, before and after its farthest point.

    Args:
        position: in the direction before the turn, float64[K] [m].
        force: float64[K] [N].
        valid: bool[K].
        turn: strokes by the demand, which the axis may lag behind.
    """
    first, end = turn.before.start, turn.after.end
    middles = (turn.before.start + turn.before.end) // 2, (turn.after.start + turn.after.end) // 2
    top = middles[0] + int(np.argmax(position[middles[0] : middles[1] + 1]))
    sides = []
    for side in (slice(first, top + 1), slice(top, end)):
        place = position[side] - position[top]
        near = (place > -REACH) & valid[side]
        sides.append((place[near], force[side][near]))
    return sides[0], sides[1]


def _common(lengths: Iterable[float]) -> float:
    """Distance from the turn that half of the strokes reach [m], at most `REACH`."""
    known = list(lengths)
    return min(REACH, float(np.median(known))) if known else 0.0


def _average(
    parts: Sequence[tuple[FloatArray, FloatArray]], reach: float, direction: int
) -> Branch | None:
    """One branch, averaged over the distance to the turn; None where too little is near it.

    Args:
        parts: places (position in `direction` less the farthest one, so <= 0 on both sides of the
            turn) and forces of each turn [m, N].
        reach: distance up to which they are averaged [m].
        direction: of the motion before the turn.
    """
    if not parts:
        return None
    place, force = (np.concatenate(values) for values in zip(*parts, strict=True))
    place, force = place[place >= -reach], force[place >= -reach]
    # Narrow near the turn, where the force changes.
    edges = REACH * np.linspace(0.0, 1.0, _BINS + 1) ** 2
    bins = Bins(-place, edges, _FEWEST)
    if len(bins.samples) < 2:
        return None
    return Branch(direction * bins.mean(place), bins.mean(force), bins.spread(force))
