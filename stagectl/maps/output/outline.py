"""What a friction map says: figures by axis, changes since another version, steps in production."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from stagectl.history import Activation, History, StageKey
from stagectl.maps.compare import AxisChange, compare
from stagectl.maps.learning import figure_noise
from stagectl.maps.model import MapVersion
from stagectl.maps.output.surface import surface
from stagectl.report import Cell, Fact, Outline, Section, Table
from stagectl.report.formats import DASH, percent, place

_LISTED = 10
"""Changed sites that are listed."""
_FIGURES = {
    "viscous": "viscous, N s/m",
    "stiffness": "stiffness, N/m",
    "relaxation_rate": "C/Fc, 1/s",
}
"""Labels of the figures that are the same over the whole table."""


def day(time: float) -> str:
    """Seconds since 1970 as date and time in UTC."""
    return f"{datetime.fromtimestamp(time, UTC):%Y-%m-%d %H:%M}"


def map_outline(
    history: History, stage: StageKey, version: MapVersion, before: MapVersion | None
) -> Outline:
    """All that a map says.

    Args:
        history: for what happened since.
        stage: that the map describes.
        version: of the map.
        before: version to compare with; None for none.
    """
    changes = {}
    if before is not None:
        changes = changes_sections(before.number, compare(before.map, version.map))
    known = (
        f"Axis {name}: known to {percent(surface(axis).known_to, 1)}"
        for name, axis in version.map.axes.items()
    )
    return Outline(
        f"Friction map {version.number}",
        str(stage),
        [Fact("In use", "good") if version.active else Fact("Not in use", "warning")],
        f"{'; '.join(known)} (1 sigma, median over the table).",
        facts={
            "As of (UTC)": day(version.map.date),
            "Made (UTC)": day(version.made),
            "Comment": version.comment,
            "Compared with": "nothing: it is the first"
            if before is None
            else f"map {before.number}",
        },
        sections={
            "axes": _axes(version),
            "figures": _same_everywhere(history, stage, version),
            **changes,
            "steps": _steps(history, stage, before),
        },
    )


def _axes(version: MapVersion) -> Section:
    rows = []
    for name, axis in version.map.axes.items():
        values, field = np.array([site.coulomb for site in axis.sites]), axis.field()
        mean = float(values.mean())
        ends = [percent(v / mean - 1, 1, signed=True) for v in (values.min(), values.max())]
        error, sigma = field.left_out()
        ok = np.isfinite(sigma)
        left_out = percent(float(np.sqrt(np.mean(error[ok] ** 2))), 1) if ok.any() else ""
        known_to = percent(surface(axis).known_to, 1)
        length = f"{field.length * 1e3:.0f} mm"
        rows.append((name, str(len(axis.sites)), f"{mean:.3f}", *ends, known_to, length, left_out))
    titles = ("Axis", "Sites", "Fc, N", "lowest", "highest", "known to", "correlated over",
              "left out, rms")  # fmt: skip
    note = (
        "The map ends half a site spacing outside of its sites; beyond that, the value at its edge "
        "is used. Left out: how far each site is off where it is predicted from the others."
    )
    table = Table(titles, rows, on_page=("left out, rms",))
    return Section("Coulomb force over the table", table=table, note=note)


def _same_everywhere(history: History, stage: StageKey, version: MapVersion) -> Section:
    rows = []
    for name, axis in version.map.axes.items():
        rates = figure_noise(history, stage, name)
        for key, label in _FIGURES.items():
            if key in axis.figures:
                value, sigma = axis.figures[key]
                rate = percent(rates[key].rate, 2) if key in rates else DASH
                rows.append((name, label, f"{value:.4g}", f"{sigma:.2g}", rate))
    titles = ("Axis", "Figure", "Value", "± 1 sigma", "Random walk per √day")
    return Section("The same all over the table", table=Table(titles, rows))


def changes_sections(since: int, changes: Sequence[AxisChange]) -> dict[str, Section]:
    """Changes since another version, a section per axis."""
    found = {}
    for axis in changes:
        rows: list[tuple[Cell, ...]] = []
        for site in axis.sites[:_LISTED]:
            size = percent(site.change, 1, signed=True)
            mark = Fact("changed", "warning") if site.significant else ""
            rows.append((place(site.place), size, percent(site.sigma, 1), mark))
        if len(axis.sites) > _LISTED:
            rows.append((f"and {len(axis.sites) - _LISTED} more, changed less", "", "", ""))
        title = (
            f"Axis {axis.axis} since map {since}: all sites "
            f"{percent(axis.common, 1, signed=True)}; single sites beyond that: "
            f"{percent(axis.own, 1)} rms"
        )
        table = Table(("Site, mm", "Change", "± 1 sigma", ""), rows)
        found[f"changes of {axis.axis}"] = Section(title, table=table)
    return found


def _steps(history: History, stage: StageKey, before: MapVersion | None) -> Section:
    rows = []
    for s in history.steps(stage, -math.inf if before is None else before.map.date):
        where = "the whole table" if s.kind == "common" else "that place alone"
        change = percent(s.change, 1, signed=True)
        rows.append((day(s.time), s.axis, place(s.place), change, where))
    titles = ("Time (UTC)", "Axis", "Site, mm", "Step", "Where")
    return Section("Steps found in production", table=Table(titles, rows))


def at_place(version: MapVersion, at: tuple[float, float]) -> Section:
    """The value of every axis at one place [m]."""
    facts = []
    for name, axis in version.map.axes.items():
        found = axis.field().at(np.array([at]))
        low, high = (float(v[0]) for v in found.band())
        beyond = "" if found.inside[0] else " (outside of the map: the value at its edge)"
        text = f"{name}: Fc {float(found.value[0]):.3f} N, 95 % {low:.3f} to {high:.3f}{beyond}"
        facts.append(Fact(text))
    return Section(f"At ({at[0] * 1e3:g}, {at[1] * 1e3:g}) mm", facts)


def versions_sections(
    stage: StageKey, versions: Sequence[MapVersion], used: Sequence[Activation]
) -> tuple[Section, Section]:
    """All versions, and what was put into use when."""
    rows = []
    for v in versions:
        sites = "/".join(str(len(axis.sites)) for axis in v.map.axes.values())
        use = "yes" if v.active else ""
        rows.append((str(v.number), day(v.made), day(v.map.date), sites, use, v.comment))
    uses = [
        (day(use.time), "none" if use.number is None else str(use.number), use.reason)
        for use in used
    ]
    titles = ("Map", "Made (UTC)", "As of", "Sites", "In use", "Comment")
    none = () if used else (Fact("no map has been in use yet"),)
    return (
        Section(f"Maps of {stage}", table=Table(titles, rows)),
        Section("Put into use", none, Table(("Time (UTC)", "Map", "How"), uses)),
    )
