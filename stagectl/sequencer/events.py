"""What happens in a run, as data: for the progress display, the journal and the console."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.online import Estimate


@dataclass(frozen=True, slots=True)
class DriveLimited:
    """Something that a drive does without, and what follows; before it is powered."""

    text: str


@dataclass(frozen=True, slots=True)
class MoveStarted:
    """A move begins; `site` counts from 1, None outside sites."""

    site: int | None
    kind: str
    time: float


@dataclass(frozen=True, slots=True)
class Settled:
    """The wait after a move is over.

    Attributes:
        site: from 1, None outside sites.
        kind: of the move.
        duration: from the end of the demand until the hold time was full [s].
        settled: False where the timeout came first.
    """

    site: int | None
    kind: str
    duration: float
    settled: bool


@dataclass(frozen=True, slots=True)
class FrictionUpdated:
    """The estimator has looked at a move of one axis.

    Attributes:
        site: from 1, None outside sites.
        axis: its name.
        estimate: what came of it.
        compute_time: of the estimator [s].
        kind: of the move.
        place: nominal position of the site, or the move's target [m].
        distance: moved by this axis [m].
        time: of the stage when the move was over, its rest included [s].
        reach: longest distance of any axis in it [m].
    """

    site: int | None
    axis: str
    estimate: Estimate
    compute_time: float
    kind: str = "macro"
    place: tuple[float, ...] = (0.0, 0.0)
    distance: float = 0.0
    time: float = 0.0
    reach: float = 0.0


@dataclass(frozen=True, slots=True)
class Exposed:
    """The camera has taken its picture: the site is done."""

    site: int | None


@dataclass(frozen=True, slots=True)
class StretchDone:
    """A site, or an entry of a list of moves, is over and will not be done again.

    Attributes:
        number: of the stretch, from 1.
        site: the same where the recipe has sites, else None.
    """

    number: int
    site: int | None


@dataclass(frozen=True, slots=True)
class Retrying:
    """A stretch is begun again after a fault.

    Attributes:
        stretch: its number, from 1.  attempt: from 1, at most `limit`.
        fault: what happened.
    """

    stretch: int
    attempt: int
    limit: int
    fault: str


@dataclass(frozen=True, slots=True)
class MarkFound:
    """Where the fiducial of a site is: `offset` from the site [m]."""

    site: int
    offset: tuple[float, float]


@dataclass(frozen=True, slots=True)
class MarkNotFound:
    """The fiducial of this site was not found: no micro-move."""

    site: int


@dataclass(frozen=True, slots=True)
class StopNoticed:
    """The operator's request to stop has been seen; it takes effect from the next sample on."""

    reason: str


@dataclass(frozen=True, slots=True)
class Stopping:
    """The run is being brought to a stop, and why."""

    reason: str


@dataclass(frozen=True, slots=True)
class LevelStepped:
    """The friction level has stepped, which drift does not explain.

    Attributes:
        axis: its name.
        place: where [m].
        time: of the stage [s].
        change: relative.
        everywhere: the whole table has, not that place alone.
    """

    axis: str
    place: tuple[float, float]
    time: float
    change: float
    everywhere: bool


Event = (
    DriveLimited
    | MoveStarted
    | Settled
    | FrictionUpdated
    | Exposed
    | StretchDone
    | Retrying
    | MarkFound
    | MarkNotFound
    | StopNoticed
    | LevelStepped
    | Stopping
)
