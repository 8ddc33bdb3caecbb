"""The HTML page of a map: what it says, heat maps, the trend of every site."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup

from stagectl.history import History, StageKey, Trend
from stagectl.maps.model import MapAxis, MapVersion
from stagectl.maps.output.outline import map_outline
from stagectl.maps.output.surface import Surface, surface
from stagectl.report import render_page
from stagectl.report.chart import Chart, Curve
from stagectl.report.formats import place
from stagectl.report.heat_map import HeatMap, common_limits, draw_heat_map
from stagectl.store import write_atomically
from stagedata import F64

MOST = 200
"""Points of a trend that are drawn at most, the last ones."""


def write_map_page(
    path: Path, history: History, stage: StageKey, version: MapVersion, before: MapVersion | None
) -> None:
    """Write the page, atomically.

    Args:
        path: of the HTML file, replacing an existing one.
        history: for the trends.
        stage: that the map describes.
        version: to show.
        before: version to compare with; None for none.

    Raises:
        StagectlError: it cannot be written.
    """
    write_atomically(path, render_map(history, stage, version, before), "page")


def render_map(
    history: History, stage: StageKey, version: MapVersion, before: MapVersion | None
) -> str:
    """The page's HTML; arguments as `write_map_page`."""
    pictures = draw_maps(version, before)
    return render_page(
        "map.html.j2",
        map_outline(history, stage, version, before),
        axes=[
            (name, pictures[name], _trends(history, stage, name, axis))
            for name, axis in version.map.axes.items()
        ],
        has_two=before is not None,
    )


def draw_maps(version: MapVersion, before: MapVersion | None) -> dict[str, list[Markup]]:
    """Pictures of every axis: its Coulomb force, that of the version before, and what is known.

    The forces of an axis share a scale, and so do the uncertainties of all axes.
    """
    now = {name: surface(axis) for name, axis in version.map.axes.items()}
    then = {} if before is None else {n: surface(a) for n, a in before.map.axes.items() if n in now}
    doubt = common_limits([found.sigma for found in now.values()])
    drawn: dict[str, list[Markup]] = {}
    for name, axis in version.map.axes.items():
        maps = [(version, axis, now[name])]
        if before is not None and name in then:
            maps.append((before, before.map.axes[name], then[name]))
        forces = common_limits([found.value for _, _, found in maps])
        drawn[name] = [
            _picture(found, found.value, forces, "N", of,
                     f"Coulomb force, axis {name}, map {which.number}")
            for which, of, found in maps
        ]  # fmt: skip
        title = f"known to (1 sigma), axis {name}"
        doubts = 100.0 * doubt[0], 100.0 * doubt[1]
        drawn[name].append(_picture(now[name], 100.0 * now[name].sigma, doubts, "%", axis, title))
    return drawn


def _picture(
    on: Surface, values: F64, limits: tuple[float, float], unit: str, axis: MapAxis, title: str
) -> Markup:
    """One figure of an axis over the table."""
    half = [float(c[1] - c[0]) / 2 for c in (on.x, on.y)]
    x, y = (1e3 * np.append(c - h, c[-1] + h) for c, h in zip((on.x, on.y), half, strict=True))
    marks = [(1e3 * site.place[0], 1e3 * site.place[1]) for site in axis.sites]
    return draw_heat_map(HeatMap(x, y, values, limits, ("x, mm", "y, mm", unit), title, marks))


def _trends(history: History, stage: StageKey, name: str, axis: MapAxis) -> list[tuple[str, Chart]]:
    """The Coulomb force at every site over time."""
    drawn = []
    for site in axis.sites:
        trend = history.trend(stage, name, site.place, last=MOST)
        chart = None if not len(trend) else trend_chart(trend, site.coulomb)
        if chart is not None:
            drawn.append((f"{name} at {place(site.place)} mm", chart))
    return drawn


def trend_chart(trend: Trend, at_map: float) -> Chart | None:
    """Estimates with their 95 % intervals, and the map's value; None without any."""
    if "coulomb" not in trend.values:
        return None
    value, sigma = trend.values["coulomb"][-MOST:], trend.sigma["coulomb"][-MOST:]
    ok = np.isfinite(value) & np.isfinite(sigma)
    if not ok.any():
        return None
    time, value, sigma = trend.time[-MOST:][ok], value[ok], sigma[ok]
    low, high = value - 1.96 * sigma, value + 1.96 * sigma
    # A vague first estimate must not flatten all others.
    bottom = min(float(np.percentile(low, 5)), float(value.min()), at_map)
    top = max(float(np.percentile(high, 95)), float(value.max()), at_map)
    pad = 0.05 * (top - bottom) or 1.0
    ends = np.array([time[0], max(time[-1], time[0] + 1.0)])
    curves = [
        Curve("map", ends, np.full(2, at_map)),
        Curve("after", time, value, low, high, has_line=False),
    ]
    return Chart(curves, "", "N", y_range=(bottom - pad, top + pad), is_time=True)
