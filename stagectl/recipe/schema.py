"""The models of a recipe file: its keys (explained in docs/recipe.md) and their values.

They check each value by itself; `load` checks them against each other and against a machine.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, StrictInt, StringConstraints, Tag

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
from stagectl.config.parsing.validation import Section, refusal


def _no_path(name: str) -> str:
    """Refuse a name that is a path: folders are named after a recipe."""
    if "/" in name:
        raise refusal("must not contain a /: folders are named after it")
    return name


Count = Annotated[StrictInt, Field(ge=1, le=1000)]
RecipeName = Annotated[Name, AfterValidator(_no_path)]
FileName = Annotated[str, StringConstraints(min_length=1, max_length=200)]


class ProfileSection(Section):
    """`macro` and `micro`."""

    velocity: PositiveVelocity
    acceleration: PositiveAcceleration
    jerk: PositiveJerk


class SettleSection(Section):
    """`settle`."""

    window: PositiveLength
    hold: NotNegativeTime
    timeout: PositiveTime
    on_timeout: Literal["continue", "retry", "stop"] = "continue"


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


class SimulatedFiducial(Section):
    """`fiducial: {source: simulated}`."""

    source: Literal["simulated"]
    range: NotNegativeLength
    seed: Annotated[StrictInt, Field(ge=0, lt=2**63)] = 0


class NoFiducial(Section):
    """`fiducial: {source: none}`."""

    source: Literal["none"]


class FileFiducial(Section):
    """`fiducial: {source: offsets}`."""

    source: Literal["offsets"]
    file: FileName


class PluginFiducial(Section):
    """`fiducial: {source: plugin}`."""

    source: Literal["plugin"]
    name: Name


FiducialSection = Annotated[
    SimulatedFiducial | NoFiducial | FileFiducial | PluginFiducial, Field(discriminator="source")
]


class SiteLimitsSection(Section):
    """`limits`."""

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
    kind: Literal["macro", "micro", "creep", "other"] = "other"


class ExciteItem(MotionKeys):
    """`{excite: axis, shape: ..., amplitude: d, band: [f, f], duration: t}`."""

    excite: str
    shape: Literal["chirp", "multisine"] = "chirp"
    amplitude: PositiveLength
    band: Annotated[list[PositiveFrequency], Field(min_length=2, max_length=2)]
    duration: PositiveTime


class DwellItem(Section):
    """`{dwell: t}`."""

    dwell: NotNegativeTime


class RepeatItem(Section):
    """`{repeat: n, moves: [...]}`."""

    repeat: Annotated[StrictInt, Field(ge=1, le=100_000)]
    moves: Annotated[list[MoveItem], Field(min_length=1)]


_ITEMS = {
    "to": "ToItem", "reverse": "ReverseItem", "dwell": "DwellItem", "repeat": "RepeatItem",
    "excite": "ExciteItem",
}  # fmt: skip


def _item_tag(value: Any) -> str | None:
    found = [tag for key, tag in _ITEMS.items() if isinstance(value, dict) and key in value]
    return found[0] if len(found) == 1 else None


MoveItem = Annotated[
    Annotated[ToItem, Tag("ToItem")]
    | Annotated[ReverseItem, Tag("ReverseItem")]
    | Annotated[DwellItem, Tag("DwellItem")]
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
    macro: ProfileSection
    micro: ProfileSection
    settle: SettleSection
    expose: NotNegativeTime | None = None
    sites: Sites | None = None
    fiducial: FiducialSection | None = None
    moves: Annotated[list[MoveItem], Field(min_length=1)] | None = None
    lot: Label | None = None
    wafer: Label | None = None
    limits: SiteLimitsSection = SiteLimitsSection()


RepeatItem.model_rebuild()
