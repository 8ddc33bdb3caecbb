"""Velocity modes: profile velocity (pv) and cyclic synchronous velocity (csv).

Both move the demand of the position loop. pv ramps to 0x60FF with 0x6083 and 0x6084 and brakes in
time for the soft limits; bit 10 says that the velocity has been within 0x606D for 0x606E, bit 12
that it is below 0x606F. csv integrates 0x60FF from SYNC to SYNC, exactly, with the force offset
0x60B2, and stops at the soft limits.
"""

from __future__ import annotations

from fractions import Fraction

from hil_sim.cia402 import objects as o
from hil_sim.cia402.modes import (
    INTERNAL_LIMIT,
    MODE_BIT_12,
    TARGET_REACHED,
    Context,
    CyclicPosition,
    Mode,
)

SPEED_ZERO = MODE_BIT_12
_NANO = 1_000_000_000


class ProfileVelocity(Mode):
    """pv (3)."""

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._running: tuple[int, float, float] | None = None
        self._inside_ns: int | None = None

    def start(self) -> None:
        """Ramp to the target velocity from the next tick on."""
        self._running = self._inside_ns = None
        self.set_bits(0)

    def resume(self) -> None:
        """Ramp up again."""
        super().resume()
        self._running = None

    def tick(self) -> None:
        """Take a new target velocity; update velocity reached, speed zero and soft limit."""
        super().tick()
        speed = self.context.motor.velocity()
        zero = abs(speed) <= self.integer(o.VELOCITY_THRESHOLD)
        bits = self.bits & ~SPEED_ZERO | (SPEED_ZERO if zero else 0)
        if self.halted:
            self.set_bits(bits)
            return
        target = self.integer(o.TARGET_VELOCITY)
        setpoint = (
            target, self.context.rate(o.PROFILE_ACCELERATION),
            self.context.rate(o.PROFILE_DECELERATION),
        )  # fmt: skip
        if setpoint != self._running:
            self._running = setpoint
            self._inside_ns = None
            self._run(*setpoint)
            bits &= ~(TARGET_REACHED | INTERNAL_LIMIT)
        now = self.context.segment.now_ns
        if target and self.context.generator.done:
            bits |= INTERNAL_LIMIT  # stopped at the soft limit
        if abs(speed - target) > self.integer(o.VELOCITY_WINDOW):
            self._inside_ns = None
            bits &= ~TARGET_REACHED
        elif self._inside_ns is None:
            self._inside_ns = now
        if self._inside_ns is not None:
            if now - self._inside_ns >= self.integer(o.VELOCITY_WINDOW_TIME) * 1_000_000:
                bits |= TARGET_REACHED
        self.set_bits(bits)

    def _run(self, target: int, acceleration: float, deceleration: float) -> None:
        generator, motor = self.context.generator, self.context.motor
        low, high = self.soft_limits()
        limit = motor.to_true(high if target > 0 else low)
        beyond = generator.position >= limit if target > 0 else generator.position <= limit
        if target == 0 or beyond:
            generator.stop(deceleration)
        else:
            speed = abs(target) * motor.speed_unit
            generator.move(limit, speed, acceleration, deceleration)


class CyclicVelocity(CyclicPosition):
    """csv (9): bit 12 says that the drive follows the command value."""

    def start(self) -> None:
        """Follow from the next SYNC on, starting at the present demand."""
        super().start()
        motor = self.context.motor
        ratio = Fraction(repr(motor.speed_unit)) / Fraction(repr(motor.unit)) / _NANO
        self._per, self._whole = ratio.numerator, ratio.denominator
        self._fine = self._last * self._whole  # fractions of a unit, summed exactly

    def on_sync(self) -> None:
        """Take over the velocity of this SYNC."""
        if self.halted:
            return
        velocity = self.integer(o.TARGET_VELOCITY)
        force = self.integer(o.TORQUE_OFFSET)
        bits = MODE_BIT_12
        self._fine += velocity * self._ticks * self.context.motor.tick_ns * self._per
        target = (self._fine + self._whole // 2) // self._whole
        if not self._low <= target <= self._high:
            target = min(max(target, self._low), self._high)
            self._fine = target * self._whole
            bits = INTERNAL_LIMIT
        force = min(max(force, -self._force_limit), self._force_limit)
        self._before, self._last = self._last, target
        self._command(target, force, self._ticks)
        self.set_bits(bits)
