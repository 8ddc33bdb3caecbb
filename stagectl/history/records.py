"""Rows of the friction history as frozen values in SI units.

Times are seconds since 1970 UTC: the start of the run plus the stage's time since, which is virtual
under `--simulate`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from stagedata import F64

Pair = tuple[float, float]
Purpose = Literal["production", "calibration"]


@dataclass(frozen=True, slots=True)
class StageKey:
    """A stage; simulated and real stages of one name are kept apart.

    Attributes:
        machine: name in the machine file.
        simulated: on virtual drives.
    """

    machine: str
    simulated: bool

    def __str__(self) -> str:
        return f"{self.machine} (simulated)" if self.simulated else self.machine


@dataclass(frozen=True, slots=True)
class RunEntry:
    """A run that made estimates.

    Attributes:
        stage: it ran on.
        axes: of the stage.
        started: [s since 1970].
        recipe: its name.
        lot, wafer: or None.
        software: name and version that made the estimates.
        folder: of its files.
        purpose: of the run.
        seed: of a simulated stage, or None.
        uuid: identifies the run in any history; None where it was read back, or has none.
        operator, comment: of whoever ran it, or None; None where it was read back.
    """

    stage: StageKey
    axes: tuple[str, ...]
    started: float
    recipe: str
    lot: str | None
    wafer: str | None
    software: str
    folder: str
    purpose: Purpose = "production"
    seed: int | None = None
    uuid: str | None = field(default=None, compare=False)
    operator: str | None = field(default=None, compare=False)
    comment: str | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class RunFilter:
    """Which runs to list.

    Attributes:
        recipe, lot, wafer, purpose: of the run; None for any.
        since, until: it began between these [s since 1970].
        last: at most so many, the last ones.
    """

    recipe: str | None = None
    lot: str | None = None
    wafer: str | None = None
    purpose: str | None = None
    since: float = -math.inf
    until: float = math.inf
    last: int = 100


@dataclass(frozen=True, slots=True)
class AxisFriction:
    """What a run has shown of an axis.

    Attributes:
        estimates: made, of which `accepted` were accepted.
        accepted: their number.
        coulomb, sigma: Coulomb force accepted last, and its standard deviation [N]; None where
            nothing was accepted, or the friction law has no such figure.
    """

    estimates: int
    accepted: int
    coulomb: float | None
    sigma: float | None


@dataclass(frozen=True, slots=True)
class RunFriction:
    """A run in the history.

    Attributes:
        number: of the run in the history.
        entry: as entered.
        outcome: or None where it is not known.
        axes: name -> friction, of those that have estimates.
    """

    number: int
    entry: RunEntry
    outcome: str | None
    axes: Mapping[str, AxisFriction]


@dataclass(frozen=True, slots=True)
class EstimateRecord:
    """Friction of one axis as estimated from one move.

    Attributes:
        run: number of the run in the history.
        axis: its name.
        kind: of the move (macro, micro, ...).
        site: from 1, or None.
        place: nominal position of the site, or the move's target [m].
        time: [s since 1970].
        distance: moved by this axis [m].
        accepted: whether the model adopted it.
        reason: why not, or None.
        figures: name -> value in the model after the move (SI).
        covariance: of the figures in the order of `figures`, row by row, n * n entries.
        level: factor on the Coulomb force at the end of the move, 1 + w.
        measured: sliding level Fc (1 + w) that this move alone showed at its end, and its
            standard deviation [N]; None where it showed none.
        temperature: [deg C], or None.
        number: of the estimate in its run, from 1; None where it was read back, or has none.
    """

    run: int
    axis: str
    kind: str
    site: int | None
    place: Pair
    time: float
    distance: float
    accepted: bool
    reason: str | None
    figures: Mapping[str, float]
    covariance: tuple[float, ...]
    level: float = 1.0
    measured: tuple[float, float] | None = None
    temperature: float | None = None
    number: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if len(self.covariance) != len(self.figures) ** 2:
            raise ValueError(
                f"covariance: {len(self.covariance)} entries for {len(self.figures)} figures"
            )

    def sigma(self, figure: str) -> float:
        """Standard deviation of one figure, in its unit."""
        i = list(self.figures).index(figure)
        return math.sqrt(max(self.covariance[i * (len(self.figures) + 1)], 0.0))


@dataclass(frozen=True, slots=True)
class Measurement:
    """The sliding level that one move alone has shown, without prior belief.

    Attributes:
        axis: its name.
        place: nominal position [m].
        time: [s since 1970].
        value: Fc (1 + w) at the end of the move [N].
        sigma: its standard deviation, w not included [N].
    """

    axis: str
    place: Pair
    time: float
    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class StepRecord:
    """A step of the level by more than drift explains.

    Attributes:
        run: number of the run in the history.
        axis: its name.
        place: [m].
        time: [s since 1970].
        change: relative.
        kind: "site", or "common" for the whole table.
        number: of the step in its run, from 1; None where it was read back, or has none.
    """

    run: int
    axis: str
    place: Pair
    time: float
    change: float
    kind: str
    number: int | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class StoredMap:
    """A version of a friction map as stored.

    Attributes:
        number: from 1, per stage.
        made: [s since 1970].
        comment: by its maker.
        active: whether runs use it.
        content: JSON of `stagectl.maps.model`.
    """

    number: int
    made: float
    comment: str
    active: bool
    content: str


@dataclass(frozen=True, slots=True)
class Activation:
    """A map became active at `time` [s since 1970]; `number` is None where none is since then."""

    number: int | None
    time: float
    reason: str


@dataclass(frozen=True, slots=True)
class Wear:
    """Moves and distance travelled [m] of one axis since some moment, at all places."""

    moves: int
    distance: float


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """Accepted estimates of one axis at one place in order of time, n of them.

    Attributes:
        time: [s since 1970], shape (n,).
        values: figure -> value, shape (n,); nan where an estimate lacks it.
        sigma: figure -> its standard deviation, shape (n,).
        level: factor on the Coulomb force at the end of the move, shape (n,).
        temperature: [deg C], nan where unknown, shape (n,).
        kind: of each move.
        run: number of its run.
    """

    time: F64
    values: Mapping[str, F64]
    sigma: Mapping[str, F64]
    level: F64
    temperature: F64
    kind: tuple[str, ...]
    run: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.time)
