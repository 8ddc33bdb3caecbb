"""Events of a run, for the journal, the progress display and the console."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.online import Estimate


@dataclass(frozen=True, slots=True)
class Limitation:
    """What the operator should know of the stage; `text` says it, and what follows or to do.

    A drive lacks an optional function, the host does not compensate an effect of its machine file,
    or the stage oscillates or settles ever later.
    """

    text: str


@dataclass(frozen=True, slots=True)
class MoveStarted:
    """A move begins; `site` counts from 1, None outside sites."""

    site: int | None
    kind: str
    time: float


@dataclass(frozen=True, slots=True)
class Waiting:
    """The stage holds still.

    Attributes:
        site: from 1, None outside sites.
        reason: in a word: "settling".
        most: longest wait [s]; None where it is unknown.
    """

    site: int | None
    reason: str
    most: float | None


@dataclass(frozen=True, slots=True)
class Settled:
    """The wait after a move has ended.

    Attributes:
        site: from 1, None outside sites.
        kind: of the move.
        duration: from the end of the demand until the axes had stayed in the window [s].
        settled: False where the timeout came first.
    """

    site: int | None
    kind: str
    duration: float
    settled: bool


@dataclass(frozen=True, slots=True)
class FrictionUpdated:
    """The estimator has evaluated a move of one axis.

    Attributes:
        site: from 1, None outside sites.
        axis: its name.
        estimate: its result, accepted or not.
        compute_time: of the estimator [s].
        kind: of the move.
        place: nominal position of the site, or the move's target [m].
        distance: moved by this axis [m].
        time: of the stage at the end of the rest after the move [s].
        reach: longest distance of any axis in the move [m].
        local: Coulomb force of the estimate over the one that the run goes on with: known effects
            change it from place to place and in time.
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
    local: float = 1.0


@dataclass(frozen=True, slots=True)
class Exposed:
    """The camera has exposed the site."""

    site: int | None


@dataclass(frozen=True, slots=True)
class SegmentDone:
    """A site, or an entry of a list of moves, is complete and will not be repeated.

    Attributes:
        number: of the segment, from 1.
        site: the same where the recipe has sites, else None.
    """

    number: int
    site: int | None


@dataclass(frozen=True, slots=True)
class Retrying:
    """A segment is repeated after a fault.

    Attributes:
        segment: its number, from 1.
        attempt: from 1, at most `limit`.
        limit: attempts allowed.
        fault: what happened.
    """

    segment: int
    attempt: int
    limit: int
    fault: str


@dataclass(frozen=True, slots=True)
class Paused:
    """The run pauses at rest, the axes held, for at most `most` [s]."""

    most: float


@dataclass(frozen=True, slots=True)
class Continued:
    """The paused run goes on, after `duration` [s]."""

    duration: float


@dataclass(frozen=True, slots=True)
class MarkFound:
    """The fiducial of a site was found at `offset` from the site [m]."""

    site: int
    offset: tuple[float, float]


@dataclass(frozen=True, slots=True)
class MarkNotFound:
    """The fiducial of a site was not found: there is no micro-move."""

    site: int


@dataclass(frozen=True, slots=True)
class StopNoticed:
    """The operator's request to stop takes effect from the next sample on."""

    reason: str


@dataclass(frozen=True, slots=True)
class Stopping:
    """The run is ending early, for this reason."""

    reason: str


@dataclass(frozen=True, slots=True)
class LevelStepped:
    """The friction level has stepped by more than drift explains.

    Attributes:
        axis: its name.
        place: where [m].
        time: of the stage [s].
        change: relative.
        everywhere: on the whole table, not at this place alone.
    """

    axis: str
    place: tuple[float, float]
    time: float
    change: float
    everywhere: bool


@dataclass(frozen=True, slots=True)
class ObserverFound:
    """The watchdog of an observer has found something.

    Attributes:
        axis: its name.
        time: of the stage, when the correction was frozen [s].
        out: it stays out; False where it acts again.
        text: what was found, with the axis.
    """

    axis: str
    time: float
    out: bool
    text: str


Event = (
    Limitation
    | MoveStarted
    | Waiting
    | Settled
    | FrictionUpdated
    | Exposed
    | SegmentDone
    | Retrying
    | Paused
    | Continued
    | MarkFound
    | MarkNotFound
    | StopNoticed
    | LevelStepped
    | ObserverFound
    | Stopping
)
