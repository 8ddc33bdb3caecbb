"""A validated recipe: frozen, independent of file and machine.

`load` makes it; `plan` turns it into steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from stagectl.recipe import schema

Pair = tuple[float, float]

MAX_STEPS = 100_000
"""Largest number of moves and dwells after repeats are unrolled."""


@dataclass(frozen=True, slots=True)
class To:
    """Move to an absolute position [m]."""

    target: Pair
    kind: schema.Kind
    profile: schema.Profile


@dataclass(frozen=True, slots=True)
class Reverse:
    """Move one axis by `distance` [m] against the direction of its last move."""

    distance: float
    axis: int
    kind: schema.Kind
    profile: schema.Profile


@dataclass(frozen=True, slots=True)
class Excite:
    """Shake one axis around where it is.

    Attributes:
        axis: its number.
        shape: of the excitation.
        amplitude: largest [m]; less where the profile asks for less.
        band: lowest and highest frequency [Hz].
        duration: [s].
        profile: largest velocity, acceleration and jerk.
    """

    axis: int
    shape: schema.Shape
    amplitude: float
    band: tuple[float, float]
    duration: float
    profile: schema.Profile


@dataclass(frozen=True, slots=True)
class Repeat:
    """The moves, repeated `count` times."""

    count: int
    moves: tuple[Move, ...]


Move = To | Reverse | Excite | schema.Dwell | Repeat


def count_unrolled(moves: tuple[Move, ...]) -> int:
    """Number of moves and dwells of a list with its repeats unrolled."""
    return sum(m.count * count_unrolled(m.moves) if isinstance(m, Repeat) else 1 for m in moves)


def unroll(
    moves: tuple[Move, ...], at: tuple[str | int, ...] = ("moves",)
) -> Iterator[tuple[tuple[str | int, ...], To | Reverse | Excite | schema.Dwell]]:
    """The moves in order with repeats unrolled, each with its location in the recipe file."""
    for index, move in enumerate(moves):
        if isinstance(move, Repeat):
            for _ in range(move.count):
                yield from unroll(move.moves, (*at, index, "moves"))
        else:
            yield (*at, index), move


@dataclass(frozen=True, slots=True)
class ListedMarks:
    """Marks from a file: site -> offset from the site [m]; other sites have none."""

    offsets: dict[int, Pair]

    def find(self, site: int, position: Pair) -> Pair | None:
        """The offset listed for the site; None if there is none."""
        return self.offsets.get(site)


FiducialSource = schema.SimulatedMark | schema.NoMark | ListedMarks | schema.PluginMark


@dataclass(frozen=True, slots=True)
class Excursion:
    """A calibration move near its site.

    Attributes:
        offset: of its target from the site [m].
        kind: of the move.
        profile: its limits.
    """

    offset: Pair
    kind: schema.Kind
    profile: schema.Profile


@dataclass(frozen=True, slots=True)
class Recipe:
    """A validated recipe: either `sites` to visit or a list of `moves`; the other is empty.

    Attributes:
        name: the recipe's name.
        axes: names of the two axes, in the order of all coordinate pairs.
        macro, micro: profiles of the moves to sites and onto marks.
        expose: exposure time at a site [s].
        sites: positions [m] in the order of visits; sites are numbered from 1.
        text: the file's text as read.  source: name of the file.
        notes: keys without effect, for the operator.
        excursions: calibration moves at every site.
        slipped: calibration sites inserted into a production run: (after which site, place [m]).
        slipped_excursions: the calibration moves there.
    """

    name: str
    axes: tuple[str, str]
    macro: schema.Profile
    micro: schema.Profile
    settle: schema.Settle
    expose: float
    sites: tuple[Pair, ...]
    fiducial: FiducialSource
    moves: tuple[Move, ...]
    lot: str | None
    wafer: str | None
    limits: schema.SiteLimits
    text: str
    source: str
    notes: tuple[str, ...] = ()
    excursions: tuple[Excursion, ...] = ()
    slipped: tuple[tuple[int, Pair], ...] = ()
    slipped_excursions: tuple[Excursion, ...] = ()

    @property
    def folder(self) -> Path:
        """The folder to which file names in the recipe are relative."""
        return Path(self.source).parent
