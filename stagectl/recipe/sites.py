"""The sites of a recipe and their marks, from grids, lists, files and plug-ins."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

from stagectl.config.parsing.validation import suggest
from stagectl.errors import ConfigError
from stagectl.recipe import schema
from stagectl.recipe.checks import Check, Location, why_outside
from stagectl.recipe.fiducial import ENTRY_POINTS
from stagectl.recipe.model import FiducialSource, ListedMarks, Pair
from stagectl.recipe.tables import read_offsets
from stagectl.recipe.tables import read_sites as read_site_table

Place = Callable[[str], str]
"""Makes the line of a problem from its reason."""

MAX_SITES = 100_000


def read_sites(check: Check, sites: object) -> tuple[tuple[Pair, ...], list[Place]]:
    """The sites in the order of visits, and for each a function that places its problems."""

    def place(*location: str | int) -> Place:
        return lambda reason: check.document.problem(location, reason)

    if isinstance(sites, schema.GridSites):
        count = sites.grid.count[0] * sites.grid.count[1]
        if count > MAX_SITES:
            check.refuse(("sites", "grid", "count"), f"more than {MAX_SITES} sites: {count}")
            return (), []
        positions = grid_positions(sites.grid)
        return positions, [place("sites", "grid")] * count
    if isinstance(sites, schema.FileSites):
        try:
            rows = read_site_table(Path(check.document.name).parent / sites.file)
        except ConfigError as error:
            check.problems += _table_problems(check, ("sites", "file"), error)
            return (), []
        return tuple(row.pair for row in rows), [row.problem for row in rows]
    if isinstance(sites, list):
        return tuple(sites), [place("sites", index) for index in range(len(sites))]
    return (), []


def read_fiducial(
    check: Check, section: schema.FiducialSection | None, sites: int
) -> FiducialSource:
    """The source of the marks. Reads files and looks up plug-ins."""
    match section:
        case schema.FileMarks():
            try:
                rows = read_offsets(Path(check.document.name).parent / section.file)
            except ConfigError as error:
                check.problems += _table_problems(check, ("fiducial", "file"), error)
                return schema.NoMark()
            check.problems += [
                row.problem(f"site {row.site} is not in the recipe, which has {sites}")
                for row in rows
                if sites and row.site is not None and row.site > sites
            ]
            return ListedMarks({row.site: row.pair for row in rows if row.site is not None})
        case schema.PluginMark():
            known = sorted(metadata.entry_points(group=ENTRY_POINTS).names)
            if section.name not in known:
                reason = f"no plug-in '{section.name}' is installed"
                reason += suggest(section.name, known)
                check.refuse(("fiducial", "name"), reason)
    return section or schema.NoMark()


def check_travel(
    check: Check, sites: tuple[Pair, ...], places: list[Place], fiducial: FiducialSource
) -> None:
    """Check that each site and its micro-move are within the travel."""
    reasons: dict[int, list[str]] = {}
    for index, site in enumerate(sites):
        low = high = (0.0, 0.0)
        if isinstance(fiducial, schema.SimulatedMark):
            low, high = (-fiducial.range,) * 2, (fiducial.range,) * 2
        elif isinstance(fiducial, ListedMarks):
            offset = fiducial.offsets.get(index + 1, (0.0, 0.0))
            low = (min(0.0, offset[0]), min(0.0, offset[1]))
            high = (max(0.0, offset[0]), max(0.0, offset[1]))
        for k, (name, axis) in enumerate(check.axes):
            reason = why_outside(site[k], low[k], high[k], axis.travel)
            if reason:
                reasons.setdefault(index, []).append(f"{reason} of axis {name}")
    first = next(iter(reasons), None)
    if first is not None and len(set(places)) == 1 < len(places):  # a grid: one place for all
        more = f" ({len(reasons)} sites in all)" if len(reasons) > 1 else ""
        reasons = {first: [reasons[first][0] + more]}
    for index, lines in list(reasons.items())[:100]:
        check.problems += [places[index](f"site {index + 1}: {line}") for line in lines]


def grid_positions(grid: schema.Grid) -> tuple[Pair, ...]:
    """Positions row by row along the first axis; in a serpentine every second row is reversed."""
    columns, rows = grid.count
    positions = []
    for row in range(rows):
        order = range(columns)
        if grid.order == "serpentine" and row % 2:
            order = range(columns - 1, -1, -1)
        for column in order:
            x = grid.origin[0] + column * grid.pitch[0]
            y = grid.origin[1] + row * grid.pitch[1]
            positions.append((round(x, 12), round(y, 12)))
    return tuple(positions)


def _table_problems(check: Check, location: Location, error: ConfigError) -> list[str]:
    """Problems of a table; those without a line are placed where the recipe names it."""
    if all(re.search(r":\d+:\d+: ", problem) for problem in error.problems):
        return list(error.problems)
    return [check.document.problem(location, str(error))]
