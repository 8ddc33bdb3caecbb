"""The data of the report's charts: error and force of moves, settling and friction over sites.

Plain values, embedded in the page as JSON. Errors are rounded to 0.1 nm and forces to 10 mN, below
the resolution of encoder and drive, at a quarter of the size.

A friction panel is one parameter of one axis, on a scale of its own. Until a move has been
informative about a parameter, its sigma is the machine file's tolerance, some hundred times larger
than later. A scale that included those bars would flatten everything that follows, so they do not
count towards it; the page draws them at the edge, with an arrow.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import median_low
from typing import Any

from stagectl.report.run_outline import single_axis_moves, window_keys
from stagectl.sequencer import arrival
from stagedata import F64, AxisSignals, Recording, aligned_demand

BEFORE = 20  # samples shown before a move
MAX_SAMPLES = 400_000  # of all moves together: about 10 MB of page
MAX_SIGMA = 4.0
"""Estimates count towards the scale up to this multiple of the panel's median sigma."""

MIN_HALF_RANGE = 0.005
"""Half of the smallest range, relative to the value: less would magnify noise."""


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
    values: F64, signals: AxisSignals, first: int, end: int, digits: int = 2
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


def friction_panels(
    entries: Iterable[Mapping[str, Any]], axes: Sequence[str], by_site: bool
) -> list[dict[str, Any]]:
    """One panel per estimated parameter and axis, the axes of a parameter in a row.

    Args:
        entries: `friction` of a summary, in order.
        axes: in the order in which they are drawn.
        by_site: place the estimates at their sites, those of one site side by side; otherwise (in
            a list of moves) number them per axis.
    """
    of_axis = {axis: [entry for entry in entries if entry["axis"] == axis] for axis in axes}
    places = {axis: _places(of, by_site) for axis, of in of_axis.items()}
    names = dict.fromkeys(
        name for of in of_axis.values() for entry in of for name in entry["parameters"]
    )
    panels = []
    for name in names:
        for axis, of in of_axis.items():
            points = [
                {"place": place, "accepted": entry["accepted"], **entry["parameters"][name]}
                for place, entry in zip(places[axis], of, strict=True)
                if name in entry["parameters"]
            ]
            points.sort(key=lambda point: point["place"])
            if points:
                low, high = panel_range(points)
                panels.append(
                    {
                        "name": name,
                        "axis": axis,
                        "unit": points[0]["unit"],
                        "low": low,
                        "high": high,
                        "points": points,
                    }
                )
    return panels


def panel_range(points: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """Lowest and highest value that a panel shows.

    It includes accepted estimates with a bar of one sigma, unless their sigma exceeds `MAX_SIGMA`
    times the median. The last accepted one is in use and always included. Refused estimates count
    only if none was accepted.

    Args:
        points: of one panel: `value`, `sigma` (None if not a number), `accepted`.
    """
    accepted = [point for point in points if point["accepted"]] or points
    finite = [point for point in accepted if point["value"] is not None]
    if not finite:
        return 0.0, 1.0
    typical = median_low([point["sigma"] or 0.0 for point in finite])
    shown = [point for point in finite if (point["sigma"] or 0.0) <= MAX_SIGMA * typical]
    ends = [
        point["value"] + side * (point["sigma"] or 0.0)
        for point in [*shown, finite[-1]]
        for side in (-1, 1)
    ]
    low, high = min(ends), max(ends)
    pad = max(0.1 * (high - low), MIN_HALF_RANGE * max(abs(low), abs(high))) or 1.0
    return (low - pad, high + pad) if math.isfinite(high - low + 2.0 * pad) else (0.0, 1.0)


def _places(entries: Sequence[Mapping[str, Any]], by_site: bool) -> list[float]:
    """Where the estimates of one axis are drawn: at 1, 2, 3, ... or around their sites."""
    if not by_site:
        return [float(k) for k in range(1, len(entries) + 1)]
    at: dict[int, int] = {}
    order = []
    for entry in entries:
        order.append(at.get(entry["site"], 0))
        at[entry["site"]] = order[-1] + 1
    return [
        round(site + min(0.2, 0.8 / at[site]) * (k - (at[site] - 1) / 2), 3)
        for site, k in zip((entry["site"] for entry in entries), order, strict=True)
    ]


def _round(value: float, digits: int) -> float:
    return round(float(value), digits) + 0.0  # + 0.0 turns -0.0 into 0.0
