"""What the thread of the stage hands to the one that talks to clients; it never waits.

Appending to and popping from a deque is atomic, so there is no lock that SYNC could wait for.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.commissioning.bus_budget import worst_bits
from drivers.errors import BusError, DriverError, LimitError
from stagectl.errors import Aborted, StagectlError
from stagectl.sequencer import Event

_AT_ONCE = 8
"""Frames of clients that are sent at once, so that setpoints are not held up."""
_BITS = tuple(worst_bits(count) for count in range(9))
_KEPT = 20_000
"""Samples that wait at most; older ones are lost where nobody takes them."""


@dataclass(frozen=True, slots=True)
class Happened:
    """An event of a run, and when [s since 1970]."""

    event: Event
    time: float


@dataclass(frozen=True, slots=True)
class Phase:
    """A phase of what is under way begins, in words."""

    text: str


@dataclass(frozen=True, slots=True)
class JobEnded:
    """A job has ended, with its result or its error."""

    job: int
    result: object = None
    error: BaseException | None = None


@dataclass(frozen=True, slots=True)
class Fault:
    """The stage has faulted; it has been stopped."""

    axis: str | None
    code: int | None
    text: str
    time: float


@dataclass(frozen=True, slots=True)
class Said:
    """Something that people should know."""

    text: str


Item = Happened | Phase | JobEnded | Fault | Said


class StopButton:
    """Pressed by any thread; the stage's stops at its next look, once."""

    def __init__(self) -> None:
        self._reason: str | None = None
        self._heeded: str | None = None

    def press(self, reason: str) -> None:
        """Stop the stage, for this reason."""
        self._reason = reason

    def check(self) -> None:
        """Raise where it was pressed since the last look.

        Raises:
            Aborted: it was; the stage's methods stop the axes on any exception.
        """
        if self._reason is not None:
            self._heeded, self._reason = self._reason, None
            raise Aborted(self._heeded)

    def was_heeded(self) -> str | None:
        """The reason if `check` has raised since this was last called, else None."""
        heeded, self._heeded = self._heeded, None
        return heeded


@dataclass(slots=True)
class Handover:
    """The way out of the stage's thread.

    Attributes:
        items: what happened, oldest first.
        samples: raw samples of the drivers, oldest first.
        stop: looked at with every sample.
        frames: of the bus while somebody listens: (time [ns], CAN-ID, data), oldest first.
        outgoing: frames that a client wants to be sent: (CAN-ID, data).
        listened_until: until when frames are kept, on the monotonic clock [s].
        send: sends a frame; set with the stage.
        bits: of all frames so far, with as many stuff bits as possible.
    """

    items: deque[Item] = field(default_factory=deque)
    samples: deque[Sequence[int]] = field(default_factory=lambda: deque(maxlen=_KEPT))
    stop: StopButton = field(default_factory=StopButton)
    frames: deque[tuple[int, int, bytes]] = field(default_factory=lambda: deque(maxlen=_KEPT))
    outgoing: deque[tuple[int, bytes]] = field(default_factory=deque)
    listened_until: float = 0.0
    send: Callable[[int, bytes], object] = field(default=lambda *_: None)
    bits: int = 0

    def give(self, item: Item) -> None:
        """Hand something over."""
        self.items.append(item)

    def sample(self, sample: Sequence[int]) -> None:
        """Hand a sample over; the sink of the stage.

        Raises:
            Aborted: the stop button was pressed.
        """
        self.samples.append(sample)
        self.look()

    def look(self) -> None:
        """Send what clients want to be sent, and look at the stop button.

        Raises:
            Aborted: it was pressed.
        """
        for _ in range(min(len(self.outgoing), _AT_ONCE)):
            with suppress(BusError):  # whoever asked waits for an answer in vain
                self.send(*self.outgoing.popleft())
        self.stop.check()

    def frame(self, time_ns: int, can_id: int, data: bytes) -> None:
        """Count a frame of the bus, and keep it while somebody listens; the tap of the stage."""
        self.bits += _BITS[len(data)]
        if self.listened_until and time.monotonic() < self.listened_until:
            self.frames.append((time_ns, can_id, data))

    def event(self, event: Event) -> None:
        """Hand an event of a run over."""
        self.items.append(Happened(event, time.time()))

    def phase(self, text: str) -> None:
        """Hand a phase over."""
        self.items.append(Phase(text))


def fault_of(error: BaseException) -> Fault | None:
    """The fault that an error of a job was, or None where nothing is wrong with the stage."""
    cause = error.__cause__ if isinstance(error, StagectlError) else error
    if isinstance(error, Aborted) or isinstance(cause, LimitError):
        return None
    if isinstance(cause, DriverError):
        return Fault(cause.axis, cause.code, str(cause), time.time())
    if isinstance(error, StagectlError):
        return None
    return Fault(None, None, f"internal error: {type(error).__name__}: {error}", time.time())
