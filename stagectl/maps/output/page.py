"""The HTML page of a map: what it says, heat maps, the trend of every site."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup

from stagectl.history import History, StageKey
from stagectl.maps.model import MapAxis, MapVersion
from stagectl.maps.output.heat_map import HeatMap, common_limits, draw_heat_map
from stagectl.maps.output.outline import map_outline
from stagectl.maps.output.surface import surface
from stagectl.maps.output.trend_chart import MOST, draw_trend
from stagectl.report import render_page
from stagectl.report.formats import place
from stagectl.store import write_atomically


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
        pictures = [
            HeatMap(
                found.x, found.y, found.value, [site.place for site in of.sites],
                f"Coulomb force, axis {name}, map {which.number}", "N", limits=forces,
            )
            for which, of, found in maps
        ]  # fmt: skip
        found = now[name]
        sites = [site.place for site in axis.sites]
        pictures.append(
            HeatMap(found.x, found.y, found.sigma, sites, f"known to (1 sigma), axis {name}", "%",
                    100.0, 1, doubt)
        )  # fmt: skip
        drawn[name] = [
            Markup(draw_heat_map(picture))  # noqa: S704  numbers and our own words only
            for picture in pictures
        ]
    return drawn


def _trends(history: History, stage: StageKey, name: str, axis: MapAxis) -> list[Markup]:
    drawn = []
    for site in axis.sites:
        trend = history.trend(stage, name, site.place, last=MOST)
        if len(trend) and "coulomb" in trend.values:
            text = draw_trend(trend, "coulomb", f"{name} at {place(site.place)} mm", site.coulomb)
            drawn.append(Markup(text))  # noqa: S704  numbers and an axis' name, which is a word
    return drawn
