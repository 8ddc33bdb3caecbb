"""Interfaces that a virtual drive needs: a CAN segment, and the plant it drives.

`bus.World` is a segment in virtual time, `bus.server.RealTimeSegment` one in real time on any
python-can bus. `plant.Plant` is the simulated plant; tests may substitute anything with its
methods.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Handlers = Mapping[int, tuple[Callable[[bytes], None], ...]]
"""What receives the data frames of a bus, by CAN-ID."""


class Timer(Protocol):
    """A pending action of a segment's clock."""

    def cancel(self) -> None:
        """Cancel the action; harmless if it has run."""


class CanSegment(Protocol):
    """The bus as a node sees it: 11-bit data frames and one clock.

    Attributes:
        now_ns: time of the frame or timer being handled [ns], 0 when the segment was made.
    """

    @property
    def now_ns(self) -> int:
        """See above."""

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame; it is delivered after the present handler has returned."""

    def at(self, time_ns: int, action: Callable[[], None]) -> Timer:
        """Call `action` at `time_ns`, or as soon as possible if that has passed."""

    def subscribe(self, can_id: int, handler: Callable[[bytes], None]) -> None:
        """Call `handler` with the payload of every frame with this id."""

    def unsubscribe(self, can_id: int, handler: Callable[[bytes], None]) -> None:
        """Undo `subscribe`; harmless if there is nothing to undo."""


class PlantPort(Protocol):
    """All axes of the plant and their control loops, in SI units.

    `axis` counts from 0 in the order of `StageSettings.axes`. Positions are true coordinates:
    zero is the index mark of the axis' encoder.
    """

    def advance_to(self, time_ns: int) -> None:
        """Integrate every control tick that starts before `time_ns` and is not yet done."""

    def power(self, axis: int, on: bool) -> None:
        """Close the loop (demand := actual, integrator := 0) or take the force off."""

    def open_loop(self, axis: int) -> None:
        """Command the force alone, until `power` closes the loop again."""

    def command(self, axis: int, position: float, force: float, ticks: int) -> None:
        """Ramp demand [m] and force offset [N] linearly to this pair within `ticks` ticks."""

    def start_clock(self) -> None:
        """Set t = 0 for effects that depend on time: a host begins to stream setpoints."""

    def encoder(self, axis: int) -> int:
        """Encoder counter [increments], noise included."""

    def force(self, axis: int) -> float:
        """Measured motor force [N]."""

    def demand(self, axis: int) -> float:
        """Position demand inside the control loop [m]."""

    def velocity(self, axis: int) -> float:
        """Low-passed encoder velocity [m/s]."""

    def following_error(self, axis: int) -> float:
        """Largest |demand - encoder| [m] over the ticks since this was last called."""


@dataclass(slots=True)
class SetpointBlock:
    """Setpoints of all axes for K instants, and what is measured there.

    Attributes:
        first_ns, period_ns: the first instant, and from each to the next [ns].
        positions, forces: demand [m] and force offset [N] commanded at each, float64[K, axes].
        ticks: control ticks in which they are reached.
        bounds: lowest and highest encoder counts, largest following error [m], float64[axes, 3].
        reports: of the instants done, before their commands, float64[k, axes, 5]: encoder counts,
            motor force [N], demand [m], encoder velocity [m/s], largest following error [m] since
            the instant before.
    """

    first_ns: int
    period_ns: int
    positions: F64
    forces: F64
    ticks: int
    bounds: F64
    reports: F64 = field(default_factory=lambda: np.empty((0, 0, 5)))


@runtime_checkable
class BlockPlantPort(PlantPort, Protocol):
    """A plant that also takes the setpoints of several instants in one call."""

    def run_block(self, block: SetpointBlock) -> None:
        """At each instant advance to it, report, and command, as long as reports are within bounds.

        It may end before any instant. Where a report is outside the bounds, the plant stays at that
        instant: it is not among the block's reports, and nothing is commanded there.
        """


class SteadyNodes(Protocol):
    """Nodes that can answer several SYNCs in one call, with the same frames as one by one."""

    def run(
        self,
        rows: Sequence[Sequence[bytes]],
        ids: Sequence[int],
        grid_ns: tuple[int, int],
        sync_id: int,
        expected: Sequence[tuple[int, int, bytes]],
        handlers: Handlers,
        answers: list[bytes],
    ) -> None:
        """Answer as many SYNCs as change nothing but setpoints and measurements; none if in doubt.

        Arguments: as those of `World.exchange_block`; `handlers` of all frames, by CAN-ID. The
        caller makes sure that no timer is due and no other frame is sent before the last SYNC.
        `answers` gets the expected frames of the SYNCs that were answered, and of no others.
        """
