"""The models of a recipe file: its keys (docs/recipe.md) and their values in SI units.

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
    acceleration: PositiveAcceleration
    jerk: PositiveJerk


@dataclass(frozen=True, slots=True, config=STRICT)
class Settle:
    """When a move counts as settled.

    Attributes:
        window: half width around the target [m].  hold: time to stay inside [s].
        timeout: longest wait after the end of the setpoints [s].
        on_timeout: what to do after the timeout.
    """

    window: PositiveLength
    hold: NotNegativeTime
    timeout: PositiveTime
    on_timeout: OnTimeout = "continue"


class Grid(Section):
    """`sites.grid`."""

    origin: LengthPair
    pitch: LengthPair
    count: Annotated[list[Count], Field(min_length=2, max_length=2)]
    order: Literal["serpentine", "raster"] = "serpentine"


class GridSites(Section):
    """`sites: {grid: ...}`."""

    grid: Grid


class FileSites(Section):
    """`sites: {file: ...}`."""

    file: FileName


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
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    source: Literal["simulated"] = "simulated"

    def find(self, site: int, position: tuple[float, float]) -> tuple[float, float]:
        """The offset of the site's mark in whole nm, always the same for a site."""
        import numpy as np

        dx, dy = np.random.default_rng((self.seed, site)).uniform(-self.range, self.range, 2)
        return round(float(dx), 9), round(float(dy), 9)


@dataclass(frozen=True, slots=True, config=STRICT)
class NoMark:
    """No fiducial, so no micro-move."""

    source: Literal["none"] = "none"

    def find(self, site: int, position: tuple[float, float]) -> None:
        """No site has a mark."""


class FileMarks(Section):
    """`fiducial: {source: offsets}`."""

    source: Literal["offsets"]
    file: FileName


@dataclass(frozen=True, slots=True, config=STRICT)
class PluginMark:
    """Marks found by a plug-in (entry point group `stagectl.fiducial`)."""

    name: Name
    source: Literal["plugin"] = "plugin"


FiducialSection = Annotated[
    SimulatedMark | NoMark | FileMarks | PluginMark, Field(discriminator="source")
]


@dataclass(frozen=True, slots=True, config=STRICT)
class SiteLimits:
    """Limits that decide whether a site passes, by its micro-move; None for no limit.

    Attributes:
        settling: longest settling time to the settle window [s].
        peak_error: largest |aligned demand - position| while the setpoint moves [m].
    """

    settling: PositiveTime | None = None
    peak_error: PositiveLength | None = None


class MotionKeys(Section):
    """Limits of a single move."""

    velocity: PositiveVelocity | None = None
    acceleration: PositiveAcceleration | None = None
    jerk: PositiveJerk | None = None


class ToItem(MotionKeys):
    """`{to: [x, y], kind: ...}`."""

    to: LengthPair
    kind: Literal["macro", "micro", "creep"] = "macro"


class ReverseItem(MotionKeys):
    """`{reverse: d, axis: a}`."""

    reverse: PositiveLength
    axis: str
    kind: Kind = "other"


class ExciteItem(MotionKeys):
    """`{excite: axis, shape: ..., amplitude: d, band: [f, f], duration: t}`."""

    excite: str
    shape: Shape = "chirp"
    amplitude: PositiveLength
    band: Annotated[list[PositiveFrequency], Field(min_length=2, max_length=2)]
    duration: PositiveTime


@dataclass(frozen=True, slots=True, config=STRICT)
class Dwell:
    """Hold still for `duration` [s]: `{dwell: t}`."""

    duration: Annotated[NotNegativeTime, Field(alias="dwell")]


class RepeatItem(Section):
    """`{repeat: n, moves: [...]}`."""

    repeat: Annotated[int, Field(ge=1, le=100_000)]
    moves: Annotated[list[MoveItem], Field(min_length=1)]


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
    macro: Profile
    micro: Profile
    settle: Settle
    expose: NotNegativeTime | None = None
    sites: Sites | None = None
    fiducial: FiducialSection | None = None
    moves: Annotated[list[MoveItem], Field(min_length=1)] | None = None
    lot: Label | None = None
    wafer: Label | None = None
    limits: SiteLimits = SiteLimits()


RepeatItem.model_rebuild()
