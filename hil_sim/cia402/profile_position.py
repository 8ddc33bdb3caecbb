"""Profile position (pp): the setpoint handshake and the drive's own profile.

The host writes 0x607A and raises controlword bit 4; the drive accepts the setpoint and raises
statusword bit 12; the host lowers bit 4, and bit 12 falls when the drive can accept another one.
With bit 5 a setpoint acts at once and discards a waiting one; without it, one setpoint waits until
the present one ends. Bit 6: relative to the previous target. Bit 9 without bit 5: the present
target is passed at its profile velocity if the waiting one lies further on in the same direction;
otherwise the axis stops there. Statusword bit 10: the position has been within 0x6067 of the target
for 0x6068.
"""

from __future__ import annotations

from dataclasses import dataclass

from hil_sim.cia402 import objects as o
from hil_sim.cia402.modes import INTERNAL_LIMIT, MODE_BIT_12, TARGET_REACHED, Context, Mode

NEW_SETPOINT, IMMEDIATELY, RELATIVE, PASSING = 1 << 4, 1 << 5, 1 << 6, 1 << 9
ACKNOWLEDGE = MODE_BIT_12
JERK_LIMITED = 3  # of 0x6086


@dataclass(frozen=True, slots=True)
class Setpoint:
    """A target with the profile parameters that came with it.

    Attributes:
        target: within the soft limits [units].
        clipped: the target asked for was beyond them.
        passing: the previous target is passed without a stop.
        speed, acceleration, deceleration, jerk: SI units; jerk None: not limited.
    """

    target: int
    clipped: bool
    passing: bool
    speed: float
    acceleration: float
    deceleration: float
    jerk: float | None


class ProfilePosition(Mode):
    """pp (1)."""

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._active: Setpoint | None = None
        self._waiting: Setpoint | None = None
        self._target = 0
        self._inside_ns: int | None = None
        self._passing = 0  # direction in which the target is passed; 0: the axis stops there

    def start(self) -> None:
        """Take the present demand as the target."""
        motor = self.context.motor
        self._active = self._waiting = None
        self._passing = 0
        self._target = motor.to_drive(motor.demand())
        self._inside_ns = None
        self.set_bits(0)

    def on_controlword(self, word: int, before: int) -> None:
        """Handshake by bit 4."""
        if word & NEW_SETPOINT and not before & NEW_SETPOINT:
            at_once = bool(word & IMMEDIATELY)
            if self.bits & ACKNOWLEDGE and not at_once:
                return  # one is active, one waits
            self._accept(at_once, bool(word & RELATIVE), bool(word & PASSING))
        elif not word & NEW_SETPOINT and self._waiting is None:
            self.set_bits(self.bits & ~ACKNOWLEDGE)

    def tick(self) -> None:
        """Start the waiting setpoint; update target reached."""
        super().tick()
        if self.halted:
            return
        done = self.context.generator.done
        if self._waiting is not None and (done or self._has_passed_target()):
            setpoint, self._waiting = self._waiting, None
            self._run(setpoint)
            if not self.integer(o.CONTROLWORD) & NEW_SETPOINT:
                self.set_bits(self.bits & ~ACKNOWLEDGE)
            return
        if not done:
            return
        window = self.integer(o.POSITION_WINDOW)
        now = self.context.segment.now_ns
        if window != o.OFF and abs(self.context.motor.position() - self._target) > window:
            self._inside_ns = None
            self.set_bits(self.bits & ~TARGET_REACHED)
            return
        if self._inside_ns is None:
            self._inside_ns = now
        if now - self._inside_ns >= self.integer(o.POSITION_WINDOW_TIME) * 1_000_000:
            self.set_bits(self.bits | TARGET_REACHED)

    def resume(self) -> None:
        """Continue to the target."""
        super().resume()
        if self._active is not None:
            self._run(self._active)
            self._pass_target()

    def _accept(self, immediately: bool, relative: bool, passing: bool) -> None:
        base = 0
        if relative:
            base = self._target if self._waiting is None else self._waiting.target
        wanted = base + self.integer(o.TARGET_POSITION)
        low, high = self.soft_limits()
        target = min(max(wanted, low), high)
        context = self.context
        jerk_limited = self.integer(o.PROFILE_TYPE) == JERK_LIMITED
        setpoint = Setpoint(
            target,
            target != wanted,
            passing,
            context.speed(o.PROFILE_VELOCITY),
            context.rate(o.PROFILE_ACCELERATION),
            context.rate(o.PROFILE_DECELERATION),
            context.rate(o.PROFILE_JERK) if jerk_limited else None,
        )
        busy = self._active is not None and not context.generator.done
        if busy and not immediately:
            self._waiting = setpoint
            if not self.halted:
                self._pass_target()
        else:
            self._waiting = None
            if self.halted:
                self._active = setpoint
                self._target = target
            else:
                self._run(setpoint)
        self.set_bits(self.bits | ACKNOWLEDGE)

    def _pass_target(self) -> None:
        """Move on to the waiting setpoint if it lies beyond the present target."""
        active, waiting = self._active, self._waiting
        if active is None or waiting is None or not waiting.passing:
            return
        generator, way = self.context.generator, waiting.target - active.target
        here = self.context.motor.to_drive(generator.position)
        if way * (active.target - here) <= 0:
            return
        self._passing = 1 if way > 0 else -1
        self._move(waiting.target, active, waiting.deceleration)

    def _has_passed_target(self) -> bool:
        here = self.context.motor.to_drive(self.context.generator.position)
        return self._passing * (here - self._target) > 0

    def _run(self, setpoint: Setpoint) -> None:
        self._active = setpoint
        self._passing = 0
        self._target = setpoint.target
        self._inside_ns = None
        bits = self.bits & ~(TARGET_REACHED | INTERNAL_LIMIT)
        self.set_bits(bits | INTERNAL_LIMIT if setpoint.clipped else bits)
        self._move(setpoint.target, setpoint, setpoint.deceleration)

    def _move(self, target: int, profile: Setpoint, deceleration: float) -> None:
        to, speed = self.context.motor.to_true(target), profile.speed
        generator = self.context.generator
        generator.move(to, speed, profile.acceleration, deceleration, profile.jerk)
