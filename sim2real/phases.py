"""A recording divided into moves and phases of motion, from its demand alone.

Phases: rest, onset (the presliding distance after a start or a reversal), acceleration, cruise,
deceleration, settling (a while after the demand has stopped), micro (motions so short that they
are presliding throughout). They are per axis: one axis may rest while another moves. Moves are
common to all axes and cover the whole recording without overlap, so that whole moves can be held
out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stagedata import FloatArray, Recording

REST, ONSET, ACCELERATION, CRUISE, DECELERATION, SETTLING, MICRO = range(7)
PHASES = ("rest", "onset", "acceleration", "cruise", "deceleration", "settling", "micro")
"""Names of the phases; a phase's number is its place here."""

MICRO_LENGTH = 200e-6
"""Longest motion that counts as a micro-move [m]."""
ONSET_LENGTH = 50e-6
"""Demanded distance after a start or reversal within which friction is still building up [m]."""
SETTLING_TIME = 0.1
"""Time after the demand has stopped that counts as settling [s]."""
_PAUSE = 0.02
"""Shortest standstill of the demand that separates two motions [s]: slow ramps move in steps."""
_SMOOTHING = 0.005
"""Time over which the demand is differentiated [s]."""
_ACCELERATING = 0.05
"""Share of a stroke's largest acceleration from which a sample counts as accelerating."""
_RESOLUTION = 0.5e-9
"""Changes of the demand below half a CiA 402 position unit count as none [m]."""
_REPEAT = 1e-6
"""Largest difference in start and demand between a move and its repetition [m]."""
_REPEAT_FORCE = 0.5
"""Largest difference in force offset between a move and its repetition [N]."""

OTHER_KIND = 0.1
"""Difference from which moves are of another kind, as a share of the travel or the top speed."""

Int8 = NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class Stroke:
    """Motion of one axis in one direction.

    Attributes:
        start, end: first sample and one past the last.
        direction: +1 or -1.
        length: demanded distance [m], >= 0.
    """

    start: int
    end: int
    direction: int
    length: float


@dataclass(frozen=True, slots=True, eq=False)
class AxisPhases:
    """Phases of one axis over K samples.

    Attributes:
        phase: int8[K], index into `PHASES`.
        velocity: float64[K], demanded [m/s].
        acceleration: float64[K], demanded [m/s^2].
        direction: int8[K], -1, 0 or 1: of the motion; at rest that of the last motion.
        strokes: in order of time.
    """

    phase: Int8
    velocity: FloatArray
    acceleration: FloatArray
    direction: Int8
    strokes: tuple[Stroke, ...]


@dataclass(frozen=True, slots=True)
class MoveBlock:
    """One move of all axes with the rest after it.

    Attributes:
        number: from 0.
        start: first sample; 0 for the first block, so that blocks cover the recording.
        moving: first sample in which the demand moves.
        end: one past the last sample in which it moves.
        stop: one past the last sample of the rest: the start of the next block.
        kind: as in the recording, else "macro" or "micro" by length.
    """

    number: int
    start: int
    moving: int
    end: int
    stop: int
    kind: str


def split_phases(demand: FloatArray, period: float) -> AxisPhases:
    """Phases of one axis.

    Args:
        demand: position demand, float64[K] [m].
        period: of the samples [s].
    """
    count = len(demand)
    velocity = _slope(demand, period)
    acceleration = _slope(velocity, period)
    phase = np.full(count, REST, dtype=np.int8)
    direction = np.zeros(count, dtype=np.int8)
    strokes: list[Stroke] = []
    settle = max(1, round(SETTLING_TIME / period))
    motions = _motions(demand, period)
    for m, (start, end) in enumerate(motions):
        following = motions[m + 1][0] if m + 1 < len(motions) else count
        for stroke in _strokes(demand, start, end):
            strokes.append(stroke)
            inside = slice(stroke.start, stroke.end)
            direction[inside] = stroke.direction
            phase[inside] = _stroke_phases(demand, acceleration, stroke)
        direction[end:following] = strokes[-1].direction
        phase[end : min(end + settle, following)] = SETTLING
    return AxisPhases(phase, velocity, acceleration, direction, tuple(strokes))


def split_moves(recording: Recording, period: float) -> tuple[MoveBlock, ...]:
    """The recording's moves, each with the rest after it; found in its demands if not listed.

    Where no moves are listed, a block begins where an axis starts from a standstill of all axes. If
    that gives fewer than three blocks, each stroke of the axis that travels farthest is one.

    Args:
        recording: of K samples.
        period: of the samples [s].

    Returns:
        Blocks in order that cover 0..K; empty where nothing moves.
    """
    count = len(recording)
    kinds: list[str]
    spans: list[tuple[int, int]]
    if recording.moves:
        spans = [(move.start, move.end) for move in recording.moves]
        kinds = [move.kind for move in recording.moves]
    else:
        demands = [signals.position_demand for signals in recording.axes.values()]
        moving = np.zeros(count, dtype=bool)
        for demand in demands:
            for start, end in _motions(demand, period):
                moving[start:end] = True
        spans = _runs(moving)
        if len(spans) < 3:
            farthest = max(demands, key=lambda d: float(np.abs(np.diff(d)).sum()))
            strokes = [s for start, end in spans for s in _strokes(farthest, start, end)]
            spans = [(s.start, s.end) for s in strokes] or spans
        kinds = [
            "macro" if max(float(np.ptp(d[start:end])) for d in demands) > MICRO_LENGTH else "micro"
            for start, end in spans
        ]
    starts = [0, *(start for start, _ in spans[1:])]
    stops = [*(start for start, _ in spans[1:]), count]
    return tuple(
        MoveBlock(i, starts[i], start, end, stops[i], kinds[i])
        for i, (start, end) in enumerate(spans)
    )


def group_repeated_moves(
    recording: Recording, found: tuple[MoveBlock, ...]
) -> tuple[tuple[int, ...], ...]:
    """Groups of moves that repeat one another: same start, demand and force offset on all axes.

    Args:
        recording: that the blocks belong to.
        found: its blocks.

    Returns:
        Numbers of the blocks of each group; groups of one are left out.
    """
    axes = recording.axes.values()
    groups: list[list[int]] = []
    for block in found:
        for group in groups:
            first = found[group[0]]
            if all(
                _alike(axis.position_demand, first, block, _REPEAT)
                and _alike(axis.force_offset, first, block, _REPEAT_FORCE)
                for axis in axes
            ):
                group.append(block.number)
                break
        else:
            groups.append([block.number])
    return tuple(tuple(group) for group in groups if len(group) > 1)


def top_speeds(demand: FloatArray, period: float) -> list[float]:
    """Highest demanded speed of each stroke of an axis [m/s]; micro-moves are left out.

    Args:
        demand: position demand, float64[K] [m].
        period: of the samples [s].
    """
    phases = split_phases(demand, period)
    speed = np.abs(phases.velocity)
    return [
        float(speed[stroke.start : stroke.end].max())
        for stroke in phases.strokes
        if stroke.length > MICRO_LENGTH
    ]


def kinds_of_moves(recording: Recording, spans: Sequence[tuple[int, int]]) -> list[int]:
    """Number of the kind of each of several parts of a recording: kinds differ in place or speed.

    Args:
        recording: whose demands say where and how fast it moves.
        spans: first sample and one past the last of each part.
    """
    demands = [axis.position_demand for axis in recording.axes.values()]
    speeds = [np.abs(np.diff(demand, append=demand[-1:])) for demand in demands]
    extents = [max(float(np.ptp(demand)), 1e-12) for demand in demands]
    fastest = [max(float(speed.max()), 1e-12) for speed in speeds]
    kinds: list[FloatArray] = []
    numbers = []
    for span in spans:
        inside = slice(*span)
        figures = [
            value
            for demand, speed, extent, top in zip(demands, speeds, extents, fastest, strict=True)
            for value in (
                float(demand[inside].min()) / extent,
                float(demand[inside].max()) / extent,
                float(speed[inside].max()) / top,
            )
        ]
        kind = np.array(figures)
        apart = [float(np.abs(kind - other).max()) for other in kinds]
        if min(apart, default=math.inf) > OTHER_KIND:
            numbers.append(len(kinds))
            kinds.append(kind)
        else:
            numbers.append(int(np.argmin(apart)))
    return numbers


def _alike(demand: FloatArray, one: MoveBlock, other: MoveBlock, within: float) -> bool:
    length = min(one.stop - one.moving, other.stop - other.moving)
    if abs((one.end - one.moving) - (other.end - other.moving)) > 1:
        return False
    first = demand[one.moving : one.moving + length]
    second = demand[other.moving : other.moving + length]
    return bool(np.abs(first - second).max() <= within)


def _slope(values: FloatArray, period: float) -> FloatArray:
    """Central difference over the smoothing time, float64[K]."""
    reach = max(1, round(_SMOOTHING / period / 2))
    padded = np.pad(values, reach, mode="edge")
    slope: FloatArray = (padded[2 * reach :] - padded[: -2 * reach]) / (2 * reach * period)
    return slope


def _motions(demand: FloatArray, period: float) -> list[tuple[int, int]]:
    """Samples (first, one past last) in which the demand moves, short pauses included."""
    changed = np.flatnonzero(np.abs(np.diff(demand)) > _RESOLUTION) + 1
    if not len(changed):
        return []
    pause = max(1, round(_PAUSE / period))
    cuts = np.flatnonzero(np.diff(changed) > pause)
    firsts = [changed[0], *changed[cuts + 1]]
    lasts = [*changed[cuts], changed[-1]]
    return [(int(first), int(last) + 1) for first, last in zip(firsts, lasts, strict=True)]


def _strokes(demand: FloatArray, start: int, end: int) -> list[Stroke]:
    """A motion divided at its reversals."""
    before = max(start - 1, 0)
    steps = np.sign(np.diff(demand[before:end]))
    moving = np.flatnonzero(steps)
    if not len(moving):
        return []
    turns = moving[1:][steps[moving[1:]] != steps[moving[:-1]]] + before + 1
    edges = [start, *(int(turn) for turn in turns), end]
    return [
        Stroke(
            first, last,
            int(np.sign(demand[last - 1] - demand[max(first - 1, 0)])),
            abs(float(demand[last - 1] - demand[max(first - 1, 0)])),
        )
        for first, last in pairwise(edges)
        if last > first
    ]  # fmt: skip


def _stroke_phases(demand: FloatArray, acceleration: FloatArray, stroke: Stroke) -> Int8:
    inside = slice(stroke.start, stroke.end)
    if stroke.length <= MICRO_LENGTH:
        return np.full(stroke.end - stroke.start, MICRO, dtype=np.int8)
    faster = acceleration[inside] * stroke.direction
    limit = _ACCELERATING * float(np.abs(faster).max())
    phase = np.full(stroke.end - stroke.start, CRUISE, dtype=np.int8)
    phase[faster > limit] = ACCELERATION
    phase[faster < -limit] = DECELERATION
    gone = np.abs(demand[inside] - demand[max(stroke.start - 1, 0)])
    phase[gone < ONSET_LENGTH] = ONSET
    return phase


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First sample and one past the last of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
