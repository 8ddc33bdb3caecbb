"""The calibration file: its sites, and when they are due. See docs/how-to/calibrate.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from stagectl.calibration.sequence import REACH, SiteSequence, choose_sequence
from stagectl.config.machine import Label, Machine
from stagectl.config.parsing.units import PositiveLength, PositiveNumber, PositiveTime
from stagectl.config.parsing.validation import Section, validate
from stagectl.config.parsing.yaml_nodes import Document, load_document, parse_document
from stagectl.errors import ConfigError
from stagectl.recipe import (
    MAX_SITES,
    NoMark,
    Pair,
    Recipe,
    grid_positions,
    parse_recipe,
    read_sites,
    schema,
)

DAY = 86400.0
_LISTED = 20
"""Problems of sites that are listed."""


class DueSection(Section):
    """`due`: a site is due when any of these limits is exceeded.

    Attributes:
        days: since its last calibration.
        moves: of an axis since then, all over the table.
        distance: likewise [m].
        uncertainty: present relative standard deviation of its level.
        change: of its level seen in production since, relative.
    """

    days: PositiveNumber = 7.0
    moves: Annotated[int, Field(ge=1)] = 50_000
    distance: PositiveLength = 2000.0
    uncertainty: PositiveNumber = 0.03
    change: PositiveNumber = 0.04


class CalibrationFile(Section):
    """The top level of a calibration file."""

    calibrate: schema.RecipeName
    sites: schema.Sites
    reach: PositiveLength = REACH
    budget: PositiveTime | None = None
    due: DueSection = DueSection()
    lot: Label | None = None


@dataclass(frozen=True, slots=True)
class Calibration:
    """A calibration.

    Attributes:
        recipe: of the sites and the moves at each.
        sequence: of the moves, with its predicted gains.
        due: limits of a site.
        budget: time for sites inserted into a production run [s], or None.
    """

    recipe: Recipe
    sequence: SiteSequence
    due: DueSection
    budget: float | None

    def at(self, sites: tuple[Pair, ...], revisit: bool = True) -> Recipe:
        """The recipe for some of the sites.

        Args:
            sites: [m].
            revisit: visit the first one again at the end, so that drift is not mistaken for a
                difference between sites.
        """
        again = sites[:1] if revisit and len(sites) > 3 else ()
        return replace(self.recipe, sites=(*sites, *again))


_RECIPE = """recipe: {name}
macro: {{velocity: {v}, acceleration: {a}, jerk: {j}}}
micro: {{velocity: 0.01, acceleration: 0.2, jerk: 20.0}}
settle: {{window: 2.0e-7, hold: 0.005, timeout: 0.15}}
expose: 0
sites: [{sites}]
fiducial: {{source: simulated, range: {reach!r}}}
"""


def load_calibration(path: Path | str, machine: Machine) -> Calibration:
    """Load a calibration and check it against the machine, as a recipe.

    Raises:
        ConfigError: it cannot be used; one line per problem.
    """
    return _calibration(load_document(path), Path(path), machine)


def parse_calibration(text: str, name: str, machine: Machine) -> Calibration:
    """The calibration of a text; errors as of `load_calibration`."""
    return _calibration(parse_document(text, name), Path(name), machine)


def _calibration(document: Document, path: Path, machine: Machine) -> Calibration:
    file = validate(document, CalibrationFile)
    if isinstance(file.sites, schema.GridSites) and math.prod(file.sites.grid.count) > MAX_SITES:
        reason = f"more than {MAX_SITES} sites: {math.prod(file.sites.grid.count)}"
        raise ConfigError(document.problem(("sites", "grid", "count"), reason))
    sites = _sites(file, path)
    problems = [
        document.problem(
            ("sites",),
            f"site {number}: ({place[0]:g}, {place[1]:g}) m with its moves of {file.reach:g} m is "
            f"outside the travel of axis {name}",
        )
        for number, place in enumerate(sites, 1)
        for coordinate, (name, axis) in zip(place, machine.axes.items(), strict=True)
        if not (axis.travel[0] + file.reach <= coordinate <= axis.travel[1] - file.reach)
    ]
    problems += [
        document.problem(("sites",), f"site {number} is site {first} again")
        for number, first in repeated_sites(sites)
    ]
    if problems:
        more = len(problems) - _LISTED
        if more > 0:
            problems[_LISTED:] = [
                document.problem(("sites",), f"and {more} more problems like these")
            ]
        raise ConfigError(problems)
    sequence = choose_sequence(machine, file.reach)
    profile = sequence.excursions[0].profile
    text = _RECIPE.format(
        name=file.calibrate, v=profile.velocity, a=profile.acceleration, j=profile.jerk,
        sites=", ".join(f"[{x!r}, {y!r}]" for x, y in sites), reach=file.reach,
    )  # fmt: skip
    recipe = parse_recipe(text, str(path), machine)
    recipe = replace(
        recipe, text=document.text, lot=file.lot, fiducial=NoMark(),
        excursions=sequence.excursions,
    )  # fmt: skip
    return Calibration(recipe, sequence, file.due, file.budget)


def recorded_sequence(text: str, name: str, machine: Machine) -> SiteSequence:
    """The moves at a site by the text of a calibration file, which messages call `name`.

    Raises:
        ConfigError: the text cannot be used.
    """
    return choose_sequence(machine, validate(parse_document(text, name), CalibrationFile).reach)


def repeated_sites(sites: Sequence[Pair]) -> list[tuple[int, int]]:
    """Numbers of the sites that were listed before, each with that of the first one there."""
    first: dict[Pair, int] = {}
    return [
        (number, first[place])
        for number, place in enumerate(sites, 1)
        if first.setdefault(place, number) < number
    ]


def _sites(file: CalibrationFile, path: Path) -> tuple[Pair, ...]:
    if isinstance(file.sites, schema.GridSites):
        return grid_positions(file.sites.grid)
    if isinstance(file.sites, schema.FileSites):
        return tuple(row.pair for row in read_sites(path.parent / file.sites.file))
    return tuple(file.sites)
