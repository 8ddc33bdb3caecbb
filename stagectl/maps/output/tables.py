"""Maps, their versions and changes as tables on a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from stagectl.history import Activation, StageKey
from stagectl.maps.compare import AxisChange
from stagectl.maps.model import MapVersion
from stagectl.maps.output.surface import surface

_LISTED = 8
FIGURES = {
    "viscous": "viscous, N s/m",
    "stiffness": "stiffness, N/m",
    "relaxation_rate": "C/Fc, 1/s",
}
"""Labels of the figures that are the same over the whole table."""


def day(time: float, seconds: bool = False) -> str:
    """Seconds since 1970 as date and time in UTC."""
    return f"{datetime.fromtimestamp(time, UTC):%Y-%m-%d %H:%M{':%S' if seconds else ''}}"


def _table(title: str | None, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1))
    for i, column in enumerate(columns):
        is_text = i == 0 or column == "comment"
        table.add_column(column, justify="left" if is_text else "right")
    return table


def summary(version: MapVersion) -> RenderableType:
    """Figures of a map, by axis."""
    use = ", in use" if version.active else ""
    title = f"map {version.number} of {version.map.stage}, as of {day(version.map.date)} UTC{use}"
    title += f": {version.comment}" if version.comment else ""
    table = _table(
        None, "axis", "sites", "Fc, N", "lowest", "highest", "known to", "correlated over",
    )  # fmt: skip
    figures = _table("the same all over the table", "axis", *FIGURES.values())
    for name, axis in version.map.axes.items():
        values = np.array([site.coulomb for site in axis.sites])
        table.add_row(
            name,
            str(len(axis.sites)),
            f"{values.mean():.3f}",
            f"{100 * (values.min() / values.mean() - 1):+.1f} %",
            f"{100 * (values.max() / values.mean() - 1):+.1f} %",
            f"{100 * surface(axis).known_to:.1f} %",
            f"{axis.field().length * 1e3:.0f} mm",
        )
        figures.add_row(
            name,
            *(
                f"{axis.figures[key][0]:.4g} ±{axis.figures[key][1]:.2g}"
                if key in axis.figures
                else "-"
                for key in FIGURES
            ),
        )
    return Group(Text(title), table, figures)  # a table breaks a title at its own width


def at_place(version: MapVersion, place: tuple[float, float]) -> RenderableType:
    """The value of every axis at one place."""
    lines = []
    for name, axis in version.map.axes.items():
        found = axis.field().at(np.array([place]))
        low, high = (float(v[0]) for v in found.band())
        beyond = "" if found.inside[0] else " (outside of the map: the value at its edge)"
        lines.append(
            f"{name} at ({place[0] * 1e3:g}, {place[1] * 1e3:g}) mm: "
            f"Fc {float(found.value[0]):.3f} N, 95 % {low:.3f} to {high:.3f}{beyond}"
        )
    return Group(*lines)


def versions_table(
    stage: StageKey, versions: Sequence[MapVersion], used: Sequence[Activation]
) -> RenderableType:
    """All versions and activations."""
    table = _table(f"maps of {stage}", "map", "made (UTC)", "as of", "sites", "in use", "comment")
    for version in versions:
        sites = "/".join(str(len(axis.sites)) for axis in version.map.axes.values())
        table.add_row(
            str(version.number), day(version.made), day(version.map.date), sites,
            "yes" if version.active else "", version.comment,
        )  # fmt: skip
    uses = _table("put into use", "time (UTC)", "map", "how")
    for entry in used:
        uses.add_row(day(entry.time), "none" if entry.number is None else str(entry.number),
                     entry.reason)  # fmt: skip
    return Group(table, uses) if used else Group(table, "no map has been in use yet")


def changes_table(old: int, new: int, changes: Sequence[AxisChange]) -> RenderableType:
    """Changes between two versions."""
    parts: list[RenderableType] = []
    for axis in changes:
        title = (
            f"{axis.axis}, map {old} to {new}: all sites {100 * axis.common:+.1f} %; single sites "
            f"beyond that: {100 * axis.own:.1f} % rms"
        )
        table = _table(
            None, "site, mm", "change", "± 1 sigma", "",
        )  # fmt: skip
        for site in axis.sites[:_LISTED]:
            table.add_row(
                f"({site.place[0] * 1e3:.1f}, {site.place[1] * 1e3:.1f})",
                f"{100 * site.change:+.1f} %",
                f"{100 * site.sigma:.1f} %",
                "changed" if site.significant else "",
            )
        parts += [Text(title), table]
        if len(axis.sites) > _LISTED:
            parts.append(f"  and {len(axis.sites) - _LISTED} more, changed less")
    return Group(*parts) if parts else Group("the two maps have no axis in common")
