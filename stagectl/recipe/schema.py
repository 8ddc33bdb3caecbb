"""The models of a recipe file: its keys and their values in SI units.

How to write one: docs/how-to/write-a-recipe.md.

They check each value by itself; `load` checks them against each other and against a machine. What
the program uses as it stands in the file is a dataclass.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, StringConstraints, Tag
from pydantic.dataclasses import dataclass

from stagectl.config.machine import Label, LengthPair, Name
from stagectl.config.parsing.units import (
    NotNegativeLength,
    NotNegativeTime,
    PositiveAcceleration,
    PositiveFrequency,
    PositiveJerk,
    PositiveLength,
    PositiveTime,
    PositiveVelocity,
)
from stagectl.config.parsing.validation import STRICT, Section, refusal


def _no_path(name: str) -> str:
    """Refuse a name that is a path: folders are named after a recipe."""
    if "/" in name:
        raise refusal("must not contain a /: folders are named after it")
    return name


Kind = Literal["macro", "micro", "creep", "other"]
Shape = Literal["chirp", "multisine"]
OnTimeout = Literal["continue", "retry", "stop"]
Count = Annotated[int, Field(ge=1, le=1000)]
RecipeName = Annotated[Name, AfterValidator(_no_path)]
FileName = Annotated[str, StringConstraints(min_length=1, max_length=200)]


@dataclass(frozen=True, slots=True, config=STRICT)
class Profile:
    """Limits of velocity [m/s], acceleration [m/s^2] and jerk [m/s^3] of a move, per axis."""

    velocity: PositiveVelocity
    """For each axis, within the machine's limits."""
    acceleration: PositiveAcceleration
    """For each axis, within the machine's limits."""
    jerk: PositiveJerk
    """For each axis, within the machine's limits."""


@dataclass(frozen=True, slots=True, config=STRICT)
class Settle:
    """When a move counts as settled."""

    window: PositiveLength
    """Both axes must be within ± this of the target; at least the encoder's increment."""
    hold: NotNegativeTime
    """And remain there for this long."""
    timeout: PositiveTime
    """Longest wait after the demand has arrived; at least `hold`, at most an hour."""
    on_timeout: OnTimeout = "continue"
    """`continue` (the site is marked), `retry` (wait again, up to three times, then end the run) or
    `stop` (end the run)."""


class Grid(Section):
    """A grid of sites."""

    origin: LengthPair
    """First site."""
    pitch: LengthPair
    """From column to column along the first axis, from row to row along the second."""
    count: Annotated[list[Count], Field(min_length=2, max_length=2)]
    """[columns, rows]."""
    order: Literal["serpentine", "raster"] = "serpentine"
    """`serpentine` runs every second row backwards, `raster` does not."""


class GridSites(Section):
    """`sites: {grid: ...}`."""

    grid: Grid
    """A grid of sites."""


class FileSites(Section):
    """`sites: {file: ...}`."""

    file: FileName
    """Comma-separated, relative to the recipe, with a header naming the columns `x` and `y`; a
    column `site` may number the rows from 1. Lines that begin with `#` are comments. Units work
    here too."""


SiteList = Annotated[list[LengthPair], Field(min_length=1, max_length=100_000)]


def _sites_tag(value: Any) -> str | None:
    if isinstance(value, list):
        return "list"
    if isinstance(value, dict) and len({"grid", "file"} & value.keys()) == 1:
        return "GridSites" if "grid" in value else "FileSites"
    return None


Sites = Annotated[
    Annotated[GridSites, Tag("GridSites")]
    | Annotated[FileSites, Tag("FileSites")]
    | Annotated[SiteList, Tag("list")],
    Discriminator(
        _sites_tag,
        custom_error_type="reason",
        custom_error_message="must be {grid: ...}, {file: ...} or a list of pairs [x, y]",
    ),
]


@dataclass(frozen=True, slots=True, config=STRICT)
class SimulatedMark:
    """Marks drawn uniformly within +-`range` [m] of each site, per axis, from `seed`."""

    range: NotNegativeLength
    """A random mark within ± this of the site on each axis."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Equal seeds give equal marks."""
    source: Literal["simulated"] = "simulated"
    """Marks are drawn at random."""

    def find(self, site: int, position: tuple[float, float]) -> tuple[float, float]:
        """The offset of the site's mark in whole nm, always the same for a site."""
        import numpy as np

        dx, dy = np.random.default_rng((self.seed, site)).uniform(-self.range, self.range, 2)
        return round(float(dx), 9), round(float(dy), 9)


@dataclass(frozen=True, slots=True, config=STRICT)
class NoMark:
    """No fiducial, so no micro-move."""

    source: Literal["none"] = "none"
    """No marks, no micro-moves."""

    def find(self, site: int, position: tuple[float, float]) -> None:
        """No site has a mark, wherever it is [m]."""


class FileMarks(Section):
    """`fiducial: {source: offsets}`."""

    source: Literal["offsets"]
    """Marks from a file."""
    file: FileName
    """With the columns `site`, `dx`, `dy`; at a site that is not listed the mark counts as not
    found, and there is no micro-move."""


@dataclass(frozen=True, slots=True, config=STRICT)
class PluginMark:
    """Marks found by a plug-in (entry point group `stagectl.fiducial`)."""

    name: Name
    """Its name in the entry point group `stagectl.fiducial`."""
    source: Literal["plugin"] = "plugin"
    """A camera: [recipes](../how-to/write-a-recipe.md#a-camera)."""


FiducialSection = Annotated[
    SimulatedMark | NoMark | FileMarks | PluginMark, Field(discriminator="source")
]


@dataclass(frozen=True, slots=True, config=STRICT)
class SiteLimits:
    """Limits that decide whether a site passes, by its micro-move."""

    settling: PositiveTime | None = None
    """Longest time to the settle window."""
    peak_error: PositiveLength | None = None
    """Largest error while the demand moves; below the following error at which an axis faults."""


class MotionKeys(Section):
    """Limits of a single move."""

    velocity: PositiveVelocity | None = None
    """Limit of this move; a creep must have it."""
    acceleration: PositiveAcceleration | None = None
    """Limit of this move."""
    jerk: PositiveJerk | None = None
    """Limit of this move."""


class ToItem(MotionKeys):
    """`{to: [x, y], kind: ...}`."""

    to: LengthPair
    """Absolute position."""
    kind: Literal["macro", "micro", "creep"] = "macro"
    """A macro-move takes velocity, acceleration and jerk from `macro`, the others from `micro`,
    unless the move states its own. Macro- and micro-moves wait for the settle window, creeps do
    not."""


class ReverseItem(MotionKeys):
    """`{reverse: d, axis: a}`."""

    reverse: PositiveLength
    """Moves one axis by this distance against the direction of its last move (the first time: in
    positive direction)."""
    axis: str
    """Its name."""
    kind: Kind = "other"
    """`other`: limits from `micro`, no waiting."""


class ExciteItem(MotionKeys):
    """`{excite: axis, shape: ..., amplitude: d, band: [f, f], duration: t}`."""

    excite: str
    """Axis that is shaken around where it is, for a frequency response."""
    shape: Shape = "chirp"
    """Of the excitation."""
    amplitude: PositiveLength
    """Largest; smaller where `velocity`, `acceleration` or `jerk` (those of `micro`, unless given)
    would be exceeded."""
    band: Annotated[list[PositiveFrequency], Field(min_length=2, max_length=2)]
    """[lowest, highest] frequency, at most a quarter of the SYNC's."""
    duration: PositiveTime
    """Of the excitation."""


@dataclass(frozen=True, slots=True, config=STRICT)
class Dwell:
    """Hold still for `duration` [s]: `{dwell: t}`."""

    duration: Annotated[NotNegativeTime, Field(alias="dwell")]
    """Stays in place for this time."""


class RepeatItem(Section):
    """`{repeat: n, moves: [...]}`."""

    repeat: Annotated[int, Field(ge=1, le=100_000)]
    """Repeats the list below it this many times."""
    moves: Annotated[list[MoveItem], Field(min_length=1)]
    """The list; repeats may be nested."""


_ITEMS = {
    "to": "ToItem", "reverse": "ReverseItem", "dwell": "Dwell", "repeat": "RepeatItem",
    "excite": "ExciteItem",
}  # fmt: skip


def _item_tag(value: Any) -> str | None:
    found = [tag for key, tag in _ITEMS.items() if isinstance(value, dict) and key in value]
    return found[0] if len(found) == 1 else None


MoveItem = Annotated[
    Annotated[ToItem, Tag("ToItem")]
    | Annotated[ReverseItem, Tag("ReverseItem")]
    | Annotated[Dwell, Tag("Dwell")]
    | Annotated[ExciteItem, Tag("ExciteItem")]
    | Annotated[RepeatItem, Tag("RepeatItem")],
    Discriminator(
        _item_tag,
        custom_error_type="reason",
        custom_error_message=f"must be a mapping with exactly one of {', '.join(_ITEMS)}",
    ),
]


class RecipeFile(Section):
    """A whole recipe file."""

    recipe: RecipeName
    """Name, used in reports and folder names; without `/`."""
    macro: Profile
    """Moves between sites."""
    micro: Profile
    """Moves onto marks."""
    settle: Settle
    """When a move is complete."""
    expose: NotNegativeTime | None = None
    """Exposure time at a site, required with `sites`; 0 for none."""
    sites: Sites | None = None
    """Positions to visit, within the travel of both axes, as must be any mark that the fiducial may
    find. Coordinates are [first axis, second axis] in the order of the machine file; sites are
    numbered from 1 in the order of the visit."""
    fiducial: FiducialSection | None = None
    """Where the micro-move goes; required with `sites`."""
    moves: Annotated[list[MoveItem], Field(min_length=1)] | None = None
    """A list of single moves instead of `sites`."""
    lot: Label | None = None
    """Stored with the run; a text or a whole number."""
    wafer: Label | None = None
    """The same."""
    limits: SiteLimits = SiteLimits()
    """Pass or fail of a site, judged on its micro-move. Summary and report have the verdicts; a
    complete run that misses them ends with exit code 4."""


RepeatItem.model_rebuild()
