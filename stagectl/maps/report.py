"""The HTML page of a map: heat maps, changes since the previous version, trend of every site."""

from __future__ import annotations

import math
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from stagectl.history import History, StageKey
from stagectl.maps.compare import AxisChange, compare
from stagectl.maps.heat_map import HeatMap, draw_heat_map
from stagectl.maps.learning import figure_noise
from stagectl.maps.model import MapAxis, MapVersion
from stagectl.maps.tables import FIGURES, day
from stagectl.maps.trend_chart import MOST, draw_trend
from stagectl.store import write_atomically

_STYLE = Path(__file__).parents[1] / "report" / "static" / "report.css"
_TEMPLATES = Path(__file__).parents[1] / "report" / "templates"
CELLS = 36
"""Cells of a heat map along each axis."""


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
    steps = history.steps(stage, -math.inf if before is None else before.map.date)
    return environment.get_template("map.html.j2").render(
        style=Markup(_STYLE.read_text(encoding="utf-8")),  # noqa: S704  our own file
        stage=str(stage),
        version=version,
        before=before,
        made=day(version.made),
        date=day(version.map.date),
        axes=[
            _axis(history, stage, name, axis, _change(changes, name))
            for name, axis in version.map.axes.items()
        ],
        steps=[
            (day(s.time), s.axis, _mm(s.place), f"{s.change:+.1%}",
             "the whole table" if s.kind == "common" else "that place alone")
            for s in steps
        ],
    )  # fmt: skip


def _axis(
    history: History, stage: StageKey, name: str, axis: MapAxis, change: AxisChange | None
) -> dict[str, object]:
    field = axis.field()
    places = field.places
    low, high = places.min(axis=0) - field.edge, places.max(axis=0) + field.edge
    x, y = (np.linspace(a, b, CELLS) for a, b in zip(low, high, strict=True))
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    found = field.at(nodes)
    value = np.where(found.inside, found.value, np.nan).reshape(CELLS, CELLS)
    doubt = np.where(found.inside, found.sigma, np.nan).reshape(CELLS, CELLS)
    sites = [site.place for site in axis.sites]
    rates = figure_noise(history, stage, name)
    error, sigma = field.left_out()
    ok = np.isfinite(sigma)
    return {
        "name": name,
        "sites": len(sites),
        "mean": f"{np.mean([s.coulomb for s in axis.sites]):.3f}",
        "span": f"{np.nanmin(value):.2f} … {np.nanmax(value):.2f}",
        "length": f"{field.length * 1e3:.0f}",
        "doubt": f"{np.nanmedian(doubt):.1%}",
        "left_out": f"{np.sqrt(np.mean(error[ok] ** 2)):.1%}" if ok.any() else "",
        "figures": [
            (
                FIGURES.get(key, key),
                f"{v:.4g}",
                f"{s:.2g}",
                f"{rates[key].rate:.2%}" if key in rates else "–",  # noqa: RUF001
            )
            for key, (v, s) in axis.figures.items()
        ],
        "pictures": [
            Markup(draw_heat_map(picture))  # noqa: S704  numbers and our own words only
            for picture in (
                HeatMap(x, y, value, sites, f"Coulomb force, axis {name}", "N"),
                HeatMap(x, y, doubt, sites, "known to (1 sigma)", "%", 100.0, 1),
            )
        ],
        "change": None if change is None else {
            "common": f"{change.common:+.1%}",
            "own": f"{change.own:.1%}",
            "sites": [
                (_mm(s.place), f"{s.change:+.1%}", f"{s.sigma:.1%}", s.significant)
                for s in change.sites[:10]
            ],
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
