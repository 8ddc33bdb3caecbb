"""Rows of the friction history, as frozen values in SI units; no database in them.

Times are seconds since 1970 UTC: when the run started, plus the stage's own time since then. Under
`--simulate` the latter is virtual.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Pair = tuple[float, float]
Purpose = Literal["production", "calibration"]


@dataclass(frozen=True, slots=True)
class StageKey:
    """Whose friction it is. Simulated and real stages of one name are kept apart.

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
    """A run that estimates came from.

    Attributes:
        stage: it ran on.  axes: of the stage.  started: [s since 1970].  recipe: its name.
        lot, wafer: or None.  software: name and version that made the estimates.
        folder: of its files.  purpose: what it was for.  seed: of a simulated stage, or None.
        uuid: what it is known by whatever its number; None where it was read, or has none.
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


@dataclass(frozen=True, slots=True)
class EstimateRecord:
    """What one move said of one axis' friction.

    Attributes:
        run: number of the run in the history.
        axis: its name.  kind: of the move (macro, micro, ...).  site: from 1, or None.
        place: nominal position of the site, or the move's target [m].
        time: [s since 1970].  distance: moved by this axis [m].
        accepted: whether it was taken over.  reason: why not, else None.
        figures: name -> value of the model in force afterwards (SI).
        covariance: of the figures in the order of `figures`, row by row, n * n entries.
        level: factor on the Coulomb force at the end of the move (its wander).
        measured: sliding level Fc (1 + w) that this move alone showed at its end, and its
            standard deviation [N]; None where it showed none.
        temperature: [deg C], or None.
        number: of the estimate in its run, from 1; None where it was read, or has none.
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
    """The sliding level that one move has shown, apart from what was believed before.

    Attributes:
        axis: its name.  place: nominal position [m].  time: [s since 1970].
        value: Fc (1 + w) at the move's end [N].  sigma: its standard deviation, w not included [N].
    """

    axis: str
    place: Pair
    time: float
    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class StepRecord:
    """A step of the level that drift does not explain.

    Attributes:
        run: number of the run in the history.  axis: its name.  place: [m].
        time: [s since 1970].  change: relative.
        kind: "site", or "common" where the whole table has stepped.
        number: of the step in its run, from 1; None where it was read, or has none.
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
    """A version of a friction map as it is kept.

    Attributes:
        number: from 1, per stage.  made: [s since 1970].  comment: the maker's.
        active: whether it is in use.  content: JSON of `stagectl.maps.model`.
    """

    number: int
    made: float
    comment: str
    active: bool
    content: str


@dataclass(frozen=True, slots=True)
class Activation:
    """When which map came into use; `number` is None where maps were put out of use."""

    number: int | None
    time: float
    reason: str


@dataclass(frozen=True, slots=True)
class Wear:
    """What one axis has done at all places since a moment: moves and distance travelled [m]."""

    moves: int
    distance: float


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """Accepted estimates of one axis at one place in the order of time, n of them.

    Attributes:
        time: [s since 1970], shape (n,).
        values: figure -> value, shape (n,); nan where an estimate did not have it.
        sigma: figure -> its standard deviation, shape (n,).
        level: factor on the Coulomb force at the end of the move, shape (n,).
        temperature: [deg C], nan where there was none, shape (n,).
        kind: of each move.  run: number of its run.
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
