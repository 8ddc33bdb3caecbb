"""The data of the report's charts: error and force of moves, settling and friction over sites.

Plain values, embedded in the page as JSON. Errors are rounded to 0.1 nm and forces to 10 mN, below
the resolution of encoder and drive, at a quarter of the size.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from stagectl.report.friction import friction_panels
from stagectl.report.run_outline import single_axis_moves, window_keys
from stagectl.sequencer import arrival
from stagedata import AxisSignals, Recording, aligned_demand

BEFORE = 20  # samples shown before a move
MAX_SAMPLES = 400_000  # of all moves together: about 10 MB of page


def chart_data(
    recording: Recording,
    summary: Mapping[str, Any],
    control_period: float,
    max_samples: int = MAX_SAMPLES,
) -> dict[str, Any]:
    """All data of the charts.

    Args:
        recording: of the run.
        summary: of the same run.
        control_period: Tc [s].
        max_samples: most samples to embed, over all moves.

    Raises:
        ValueError: the summary belongs to another recording.
    """
    period = float(summary["cycle"]["period"])
    entries = _entries(recording, summary)
    by_site = all(move.site is not None for move in recording.moves)
    shown = _shown(recording, entries, max_samples)
    moves = [
        _move(recording, number, entries[number], period, control_period / period)
        for number in shown
    ]
    return {
        "axes": list(recording.axes),
        "windows": list(window_keys(summary)),
        "placeName": "site" if by_site else "move",
        "estimateName": "site" if by_site else "estimate",
        "moves": moves,
        "left_out": len(recording.moves) - len(shown),
        "first": _typical_micro_move(moves, window_keys(summary)),
        "settling": [
            {
                "place": recording.moves[number].site if by_site else number + 1,
                "axis": axis,
                "kind": entry["kind"],
                "times": {key: _round(1e3 * t, 3) for key, t in entry["settling"].items()},
                "outside": _outside(recording, number, axis, entry["settling"]),
            }
            for number, of_axis in enumerate(entries)
            for axis, entry in of_axis.items()
        ],
        "friction": friction_panels(summary["friction"], tuple(recording.axes), by_site),
    }


def _entries(
    recording: Recording, summary: Mapping[str, Any]
) -> list[dict[str, Mapping[str, Any]]]:
    """For each move: axis -> its entry in the summary, which lists them in the same order."""
    pairs = single_axis_moves(recording)
    listed = summary["moves"]
    if [axis for _, axis in pairs] != [entry["axis"] for entry in listed]:
        raise ValueError("the summary's moves are not those of the recording")
    entries: list[dict[str, Mapping[str, Any]]] = [{} for _ in recording.moves]
    for (number, axis), entry in zip(pairs, listed, strict=True):
        entries[number][axis] = entry
    return entries


def _shown(
    recording: Recording, entries: list[dict[str, Mapping[str, Any]]], budget: int
) -> list[int]:
    """Indices of the moves to embed: all, or those of a long run that settle slowest.

    Micro-moves take precedence: they are what the stage is for.
    """

    def slowness(number: int) -> tuple[bool, float]:
        times = [t for entry in entries[number].values() for t in entry["settling"].values()]
        return recording.moves[number].kind == "micro", max(times, default=0.0)

    chosen: list[int] = []
    for number in sorted(range(len(recording.moves)), key=slowness, reverse=True):
        budget -= recording.rest_end(number) - recording.moves[number].start + BEFORE
        if budget < 0:
            break
        chosen.append(number)
    return sorted(chosen)


def _outside(recording: Recording, number: int, axis: str, keys: Iterable[str]) -> list[str]:
    """Windows that the axis is still outside of at the last sample before the next move."""
    move, signals = recording.moves[number], recording.axes[axis]
    rest = slice(move.start, recording.rest_end(number))
    measured = signals.position_actual[rest][signals.valid[rest]]
    if not len(measured):
        return list(keys)
    return [key for key in keys if abs(measured[-1] - move.target[axis]) > float(key)]


def _move(
    recording: Recording,
    number: int,
    entries: Mapping[str, Mapping[str, Any]],
    period: float,
    ratio: float,
) -> dict[str, Any]:
    move = recording.moves[number]
    first, end = max(move.start - BEFORE, 0), recording.rest_end(number)
    signals = recording.axes
    arrived = {
        axis: arrival(signals[axis].position_demand, move.target[axis], move.start, end)
        for axis in entries
    }
    return {
        "number": number + 1,
        "site": move.site,
        "kind": move.kind,
        "start": _round((first - move.start) * period * 1e3, 3),
        "step": period * 1e3,
        "arrived": {
            axis: _round((k - move.start) * period * 1e3, 3)
            for axis, k in arrived.items()
            if k is not None
        },
        "entries": {
            axis: {
                "distance": entry["distance"],
                "peak": entry["peak_error"],
                "settled": entry["settled"],
                "times": {key: _round(1e3 * t, 3) for key, t in entry["settling"].items()},
            }
            for axis, entry in entries.items()
        },
        "error": {a: _error(s, first, end, ratio) for a, s in signals.items()},
        "force": {a: _values(s.force_actual, s, first, end) for a, s in signals.items()},
        "offset": {
            a: [_round(v, 2) for v in s.force_offset[first:end]] for a, s in signals.items()
        },
    }


def _error(signals: AxisSignals, first: int, end: int, ratio: float) -> list[float | None]:
    error = (aligned_demand(signals, ratio) - signals.position_actual) * 1e9
    return _values(error, signals, first, end, 1)


def _values(
    values: npt.NDArray[np.float64], signals: AxisSignals, first: int, end: int, digits: int = 2
) -> list[float | None]:
    """A slice as plain numbers; None for missed samples."""
    return [
        _round(value, digits) if valid else None
        for value, valid in zip(values[first:end], signals.valid[first:end], strict=True)
    ]


def _typical_micro_move(moves: list[dict[str, Any]], keys: tuple[str, ...]) -> int:
    """Index of the move to show first: the micro-move with the median settling time."""
    key = keys[0] if keys else ""
    times = sorted(
        (max((entry["times"][key] for entry in move["entries"].values()), default=0.0), i)
        for i, move in enumerate(moves)
        if move["kind"] == "micro" and move["entries"]
    )
    return times[len(times) // 2][1] if times else 0


def _round(value: float, digits: int) -> float:
    return round(float(value), digits) + 0.0  # + 0.0 turns -0.0 into 0.0
