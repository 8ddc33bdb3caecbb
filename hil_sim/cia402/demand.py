"""What moves an axis' position demand: SYNC in the cyclic modes, otherwise the profile generator.

The generator runs once per TICK_NS, in pp, pv and homing and in every controlled stop. In the
cyclic modes the mode itself commands the motor at each SYNC, and the generator waits.
"""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.cia402.profile_generator import ProfileGenerator
from hil_sim.plant import Motor
from hil_sim.ports import CanSegment, Timer

TICK_NS = 1_000_000
"""Period of the profile generator, and of supervision outside the cyclic modes [ns]."""


class DemandSource:
    """Steps the profile generator and brings the axis to a controlled stop.

    Args:
        motor: commanded.
        segment: clock of the generator.
        advance_to: brings the plant to a time [ns].
        on_tick: called every TICK_NS while the generator is in charge; commands its next step.

    Attributes:
        generator: of the drive.
        following: SYNC moves the demand.
    """

    def __init__(
        self,
        motor: Motor,
        segment: CanSegment,
        advance_to: Callable[[int], None],
        on_tick: Callable[[], None],
    ) -> None:
        self.generator = ProfileGenerator(TICK_NS * 1e-9)
        self.following = False
        self._motor = motor
        self._segment = segment
        self._advance_to = advance_to
        self._on_tick = on_tick
        self._ticks = TICK_NS // motor.tick_ns
        self._timer: Timer | None = None
        self._due_ns = 0
        self._after_stop: Callable[[], None] | None = None

    def select(self, powered: bool, following: bool) -> None:
        """Choose what moves the demand from now on.

        Args:
            powered: the force is on; without it nothing moves the demand.
            following: SYNC does, not the generator.
        """
        if self.following and powered and not following:
            # At once, also where there is nothing to brake: this takes the force offset out.
            self._command_step()
        self.following = following
        ticking = powered and not following
        if ticking and self._timer is None:
            self._schedule(self._segment.now_ns + TICK_NS)
        elif not ticking and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def take_over(self, velocity: float) -> None:
        """Let the generator continue from the present demand at this velocity [m/s]."""
        self.generator.take_over(self._motor.demand(), velocity)

    def step(self) -> None:
        """Command the next step of a profile that has not come to rest."""
        if not self.generator.done:
            self._command_step()

    @property
    def stopping(self) -> bool:
        """Whether a controlled stop is under way."""
        return self._after_stop is not None

    def stop(self, deceleration: float, then: Callable[[], None]) -> None:
        """Brake with this deceleration [m/s^2]; `then` is called by `end_stop`."""
        self.generator.stop(deceleration)
        self._after_stop = then

    def end_stop(self) -> None:
        """Complete the stop if the demand is at rest."""
        if self.generator.done and self._after_stop is not None:
            then, self._after_stop = self._after_stop, None
            then()

    def abandon_stop(self) -> None:
        """Forget a stop under way: the force is off."""
        self._after_stop = None

    def _command_step(self) -> None:
        self._motor.command_true(self.generator.step(), self._ticks)

    def _schedule(self, due_ns: int) -> None:
        self._due_ns = due_ns
        self._timer = self._segment.at(due_ns, self._fire)

    def _fire(self) -> None:
        now = self._segment.now_ns
        self._advance_to(now)
        late = (now - self._due_ns) // TICK_NS  # whole periods; 0 in virtual time
        self._schedule(self._due_ns + (late + 1) * TICK_NS)
        if late and not self.generator.done:
            for _ in range(late):  # the profile keeps its time
                self.generator.step()
            if self.generator.done:  # `step` would not command its end any more
                self._motor.command_true(self.generator.position, self._ticks)
        self._on_tick()
