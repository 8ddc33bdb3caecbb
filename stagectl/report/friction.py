"""The friction panels of the report: one parameter of one axis each, on a scale of its own.

Until a move has been informative about a parameter, its sigma is the machine file's tolerance, some
hundred times larger than later. A scale that included those bars would flatten everything that
follows, so they do not count towards it; the page draws them at the edge, with an arrow.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import median_low
from typing import Any

MAX_SIGMA = 4.0
"""Estimates count towards the scale up to this multiple of the panel's median sigma."""

MIN_HALF_RANGE = 0.005
"""Half of the smallest range, relative to the value: less would magnify noise."""


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
