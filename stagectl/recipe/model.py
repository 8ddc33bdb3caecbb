"""What a recipe says, as frozen values: SI units, checked, no file and no machine in it.

Made by `stagectl.recipe.load.load_recipe`; turned into steps by `stagectl.recipe.plan.plan`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Pair = tuple[float, float]
Kind = Literal["macro", "micro", "creep", "other"]
OnTimeout = Literal["continue", "retry", "stop"]

MAX_STEPS = 100_000
"""Most moves and dwells that a recipe may unroll to."""


@dataclass(frozen=True, slots=True)
class Profile:
    """Largest velocity [m/s], acceleration [m/s^2] and jerk [m/s^3] of a move, for each axis."""

    velocity: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, slots=True)
class Settle:
    """When a move counts as settled.

    Attributes:
        window: half width around the target [m].  hold: time inside it [s].
        timeout: longest wait after the end of the demand [s].
        on_timeout: what to do then.
    """

    window: float
    hold: float
    timeout: float
    on_timeout: OnTimeout = "continue"


@dataclass(frozen=True, slots=True)
class To:
    """Move to an absolute position [m]."""

    target: Pair
    kind: Kind
    profile: Profile


@dataclass(frozen=True, slots=True)
class Reverse:
    """Move one axis by `distance` [m] against the direction of its last move."""

    distance: float
    axis: int
    kind: Kind
    profile: Profile


@dataclass(frozen=True, slots=True)
class Dwell:
    """Stay for `duration` [s]."""

    duration: float


@dataclass(frozen=True, slots=True)
class Repeat:
    """The moves, `count` times over."""

    count: int
    moves: tuple[Move, ...]

    def unrolled(self) -> int:
        """Moves and dwells in all, without unrolling them."""
        return self.count * unrolled(self.moves)


Move = To | Reverse | Dwell | Repeat


def unrolled(moves: tuple[Move, ...]) -> int:
    """How many moves and dwells a list comes to."""
    return sum(m.unrolled() if isinstance(m, Repeat) else 1 for m in moves)


def unroll(
    moves: tuple[Move, ...], at: tuple[str | int, ...] = ("moves",)
) -> Iterator[tuple[tuple[str | int, ...], To | Reverse | Dwell]]:
    """The moves in the order they happen, each with its place in the recipe file."""
    for index, move in enumerate(moves):
        if isinstance(move, Repeat):
            for _ in range(move.count):
                yield from unroll(move.moves, (*at, index, "moves"))
        else:
            yield (*at, index), move


@dataclass(frozen=True, slots=True)
class SimulatedMark:
    """A mark uniformly within +-`range` [m] of the site, each axis, drawn from seed and site."""

    range: float
    seed: int


@dataclass(frozen=True, slots=True)
class NoMark:
    """No fiducial: no micro-move."""


@dataclass(frozen=True, slots=True)
class ListedMarks:
    """Marks from a file: offset from the site [m] by site; sites without one are not found."""

    offsets: dict[int, Pair]


@dataclass(frozen=True, slots=True)
class PluginMark:
    """Marks found by a plug-in (entry point group `stagectl.fiducial`)."""

    name: str


FiducialSource = SimulatedMark | NoMark | ListedMarks | PluginMark


@dataclass(frozen=True, slots=True)
class SiteLimits:
    """Pass or fail per site, judged on its micro-move; None means not judged.

    Attributes:
        settling: longest settling to the settle window [s].
        peak_error: largest |aligned demand - position| while the demand moves [m].
    """

    settling: float | None = None
    peak_error: float | None = None


@dataclass(frozen=True, slots=True)
class Excursion:
    """A move of a calibration, near its site.

    Attributes:
        offset: of its target from the site [m].
        kind: of the move.
        profile: of it.
    """

    offset: Pair
    kind: Kind
    profile: Profile


@dataclass(frozen=True, slots=True)
class Recipe:
    """A validated recipe: either `sites` (visited one by one) or `moves`, the other is empty.

    Attributes:
        name: the recipe's name.
        axes: names of the two axes, in the order of every pair of coordinates.
        macro, micro: profiles of the moves between sites and onto the mark.
        expose: time the camera takes at a site [s].
        sites: positions [m] in the order of the visit; sites count from 1.
        text: the file's text as read.  source: how the file was named.
        notes: what in the file has no effect, for the operator.
        excursions: moves made at every site: a calibration.
        slipped: calibrations slipped into a production run: (behind which site, place [m]).
        slipped_excursions: the moves made there.
    """

    name: str
    axes: tuple[str, str]
    macro: Profile
    micro: Profile
    settle: Settle
    expose: float
    sites: tuple[Pair, ...]
    fiducial: FiducialSource
    moves: tuple[Move, ...]
    lot: str | None
    wafer: str | None
    limits: SiteLimits
    text: str
    source: str
    notes: tuple[str, ...] = ()
    excursions: tuple[Excursion, ...] = ()
    slipped: tuple[tuple[int, Pair], ...] = ()
    slipped_excursions: tuple[Excursion, ...] = ()

    @property
    def folder(self) -> Path:
        """Where files named in the recipe are looked for."""
        return Path(self.source).parent
