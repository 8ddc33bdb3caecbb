"""What happens in a run, as data: for the progress display, the journal and the console."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.split_horizon import Estimate


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
    """The estimator has looked at a move of one axis; `compute_time` in s."""

    site: int | None
    axis: str
    estimate: Estimate
    compute_time: float


@dataclass(frozen=True, slots=True)
class Exposed:
    """The camera has taken its picture: the site is done."""

    site: int | None


@dataclass(frozen=True, slots=True)
class MarkNotFound:
    """The fiducial of this site was not found: no micro-move."""

    site: int


@dataclass(frozen=True, slots=True)
class Stopping:
    """The run is being brought to a stop, and why."""

    reason: str


Event = MoveStarted | Settled | FrictionUpdated | Exposed | MarkNotFound | Stopping
