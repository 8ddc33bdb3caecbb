"""The friction panels of the report: the course of one figure of one axis each, on its own scale.

Before a move has told a figure, its sigma is that of the machine file, a hundred times what it is
later. A scale that held those bars would show the course in force as a flat line. So what was not
known yet does not set the scale; the page draws it at the edge, with an arrow.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import median_low
from typing import Any

KNOWN = 4.0
"""An estimate sets the scale where its sigma is at most so many times the panel's median."""

LEAST = 0.005
"""Half of the least scale, of the figure's size: less would blow nothing up to a course."""


def friction_panels(
    entries: Iterable[Mapping[str, Any]], axes: Sequence[str], by_site: bool
) -> list[dict[str, Any]]:
    """One panel for each figure and axis that was estimated, the axes of a figure in a row.

    Args:
        entries: `friction` of a summary, in order.
        axes: in the order in which they are drawn.
        by_site: estimates stand at their site, those of one site side by side; in a list of moves
            there is none, and they are counted by axis.
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
                low, high = scale(points)
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


def scale(points: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """Least and greatest value that a panel shows.

    Every accepted figure is in it with its bar of one sigma, but those whose sigma is more than
    `KNOWN` times the median. The last accepted figure always is: it is the one in force. Refused
    figures may be anywhere and are in it only where none was accepted.

    Args:
        points: of one panel: `value`, `sigma` (either None where it is not a number), `accepted`.
    """
    accepted = [point for point in points if point["accepted"]] or points
    told = [point for point in accepted if point["value"] is not None]
    if not told:
        return 0.0, 1.0
    typical = median_low([point["sigma"] or 0.0 for point in told])
    shown = [point for point in told if (point["sigma"] or 0.0) <= KNOWN * typical]
    ends = [
        point["value"] + side * (point["sigma"] or 0.0)
        for point in [*shown, told[-1]]
        for side in (-1, 1)
    ]
    low, high = min(ends), max(ends)
    pad = max(0.1 * (high - low), LEAST * max(abs(low), abs(high))) or 1.0
    return (low - pad, high + pad) if math.isfinite(high - low + 2.0 * pad) else (0.0, 1.0)


def _places(entries: Sequence[Mapping[str, Any]], by_site: bool) -> list[float]:
    """Where the estimates of one axis stand: at 1, 2, 3; or about their site, without overlap."""
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
