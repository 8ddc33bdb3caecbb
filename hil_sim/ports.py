"""Interfaces that a virtual drive needs: a CAN segment, and the plant it drives.

`bus.World` is a segment in virtual time, `bus.server.RealTimeSegment` one in real time on any
python-can bus. `plant.Plant` is the simulated plant; tests may substitute anything with its
methods.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


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
