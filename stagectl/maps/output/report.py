"""The HTML page of a map: heat maps, changes since the previous version, trend of every site."""

from __future__ import annotations

import math
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from stagectl.history import History, StageKey
from stagectl.maps.compare import AxisChange, compare
from stagectl.maps.learning import figure_noise
from stagectl.maps.model import MapAxis, MapVersion
from stagectl.maps.output.heat_map import HeatMap, common_limits, draw_heat_map
from stagectl.maps.output.surface import surface
from stagectl.maps.output.tables import FIGURES, day
from stagectl.maps.output.trend_chart import MOST, draw_trend
from stagectl.store import write_atomically

_STYLE = Path(__file__).parents[2] / "report" / "static" / "report.css"
_TEMPLATES = Path(__file__).parents[2] / "report" / "templates"
_LISTED = 10
"""Changed sites that are listed."""


def write_map_report(
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
    text = render(history, stage, version, before)
    write_atomically(path, text, "page")


def render(
    history: History, stage: StageKey, version: MapVersion, before: MapVersion | None
) -> str:
    """The page's HTML; arguments as `write_map_report`."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    changes = [] if before is None else compare(before.map, version.map)
    pictures = draw_maps(version, before)
    steps = history.steps(stage, -math.inf if before is None else before.map.date)
    return environment.get_template("map.html.j2").render(
        style=Markup(_STYLE.read_text(encoding="utf-8")),  # noqa: S704  our own file
        stage=str(stage),
        version=version,
        before=before,
        made=day(version.made),
        date=day(version.map.date),
        axes=[
            _axis(history, stage, name, axis, _change(changes, name), pictures[name])
            for name, axis in version.map.axes.items()
        ],
        steps=[
            (day(s.time), s.axis, _mm(s.place), f"{100 * s.change:+.1f} %",
             "the whole table" if s.kind == "common" else "that place alone")
            for s in steps
        ],
    )  # fmt: skip


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


def _axis(
    history: History,
    stage: StageKey,
    name: str,
    axis: MapAxis,
    change: AxisChange | None,
    pictures: list[Markup],
) -> dict[str, object]:
    field, found = axis.field(), surface(axis)
    rates = figure_noise(history, stage, name)
    error, sigma = field.left_out()
    ok = np.isfinite(sigma)
    return {
        "name": name,
        "sites": len(axis.sites),
        "mean": f"{np.mean([s.coulomb for s in axis.sites]):.3f}",
        "span": f"{np.nanmin(found.value):.2f} to {np.nanmax(found.value):.2f}",
        "length": f"{field.length * 1e3:.0f}",
        "doubt": f"{100 * found.known_to:.1f} %",
        "left_out": f"{100 * np.sqrt(np.mean(error[ok] ** 2)):.1f} %" if ok.any() else "",
        "figures": [
            (
                FIGURES.get(key, key),
                f"{v:.4g}",
                f"{s:.2g}",
                f"{100 * rates[key].rate:.2f} %" if key in rates else "–",  # noqa: RUF001
            )
            for key, (v, s) in axis.figures.items()
        ],
        "pictures": pictures,
        "change": None if change is None else {
            "common": f"{100 * change.common:+.1f} %",
            "own": f"{100 * change.own:.1f} %",
            "sites": [
                (_mm(s.place), f"{100 * s.change:+.1f} %", f"{100 * s.sigma:.1f} %", s.significant)
                for s in change.sites[:_LISTED]
            ],
            "more": max(len(change.sites) - _LISTED, 0),
        },
        "trends": _trends(history, stage, name, axis),
    }  # fmt: skip


def _trends(history: History, stage: StageKey, name: str, axis: MapAxis) -> list[Markup]:
    drawn = []
    for site in axis.sites:
        trend = history.trend(stage, name, site.place, last=MOST)
        if len(trend) and "coulomb" in trend.values:
            text = draw_trend(trend, "coulomb", f"{name} at {_mm(site.place)} mm", site.coulomb)
            drawn.append(Markup(text))  # noqa: S704  numbers and an axis' name, which is a word
    return drawn


def _change(changes: list[AxisChange], name: str) -> AxisChange | None:
    return next((change for change in changes if change.axis == name), None)


def _mm(place: tuple[float, float]) -> str:
    return f"({place[0] * 1e3:.1f}, {place[1] * 1e3:.1f})"
