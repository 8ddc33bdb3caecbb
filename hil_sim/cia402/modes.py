"""Modes of operation: what they share, and cyclic synchronous position and torque (csp, cst).

A mode acts only in OPERATION ENABLED. In csp the target (0x607A) and the force offset (0x60B2) are
taken over at each SYNC and interpolated linearly over 0x60C2, which must be the SYNC period;
without SYNC nothing moves. In cst the force itself is the setpoint, without a position loop: at
each SYNC the sum of target torque (0x6071) and torque offset (0x60B2), within max torque (0x6072),
acts at once. Halt, quick stop or another mode closes the position loop where the axis is. In both,
bit 12 says that the drive follows the command value.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from hil_sim.cia301 import Dictionary
from hil_sim.cia402 import objects as o
from hil_sim.cia402.profile_generator import ProfileGenerator
from hil_sim.plant import Motor
from hil_sim.ports import CanSegment

# Statusword bits that belong to the mode.
TARGET_REACHED = 1 << 10
INTERNAL_LIMIT = 1 << 11
MODE_BIT_12 = 1 << 12
MODE_BIT_13 = 1 << 13


class ModeCode(IntEnum):
    """Values of 0x6060 that this drive offers; 0 holds the position."""

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6
    CYCLIC_POSITION = 8
    CYCLIC_VELOCITY = 9
    CYCLIC_TORQUE = 10


@dataclass(frozen=True, slots=True)
class Context:
    """What a mode works on.

    Attributes:
        update_statusword: called after a change of `Mode.bits`.
    """

    dictionary: Dictionary
    motor: Motor
    segment: CanSegment
    generator: ProfileGenerator
    update_statusword: Callable[[], None]

    def speed(self, key: int) -> float:
        """An object's speed, at least one unit [m/s]."""
        return max(1, self.dictionary.integer(key)) * self.motor.speed_unit

    def rate(self, key: int) -> float:
        """An object's acceleration, at least one unit [m/s^2]."""
        return max(1, self.dictionary.integer(key)) * self.motor.rate_unit


class Mode:
    """Base class, and the mode that holds the position (0).

    Attributes:
        bits: the mode's bits of the statusword.
        halted: controlword bit 8 is set.
        ticking: the profile generator moves the demand, and `tick` is due at each of its steps;
            otherwise SYNC does.
    """

    ticking = True

    def __init__(self, context: Context) -> None:
        self.context = context
        self.bits = 0
        self.halted = False

    def configure(self) -> None:
        """Read parameters again: the dictionary has changed."""

    def start(self) -> None:
        """Begin at the position where the demand is at rest or will come to rest."""
        self.set_bits(0)

    def velocity(self) -> float:
        """Velocity of the demand [m/s], from which a stop brakes."""
        return self.context.generator.velocity

    def on_controlword(self, word: int, before: int) -> None:
        """Act on a changed controlword."""

    def on_sync(self) -> None:
        """Act at a SYNC, after the RPDOs have been latched."""

    def tick(self) -> None:
        """Act once per TICK_NS, before the generator's next step is commanded."""
        if self.halted and self.context.generator.done:
            self.set_bits(self.bits | TARGET_REACHED)  # during halt: velocity is 0

    def halt(self, deceleration: float) -> None:
        """Brake with this deceleration [m/s^2] and wait; the target is kept."""
        self.halted = True
        self.set_bits(self.bits & ~TARGET_REACHED)
        self.context.generator.stop(deceleration)

    def resume(self) -> None:
        """Continue after a halt."""
        self.halted = False
        self.set_bits(self.bits & ~TARGET_REACHED)

    def set_bits(self, bits: int) -> None:
        """Set the mode's bits of the statusword."""
        if bits != self.bits:
            self.bits = bits
            self.context.update_statusword()

    def integer(self, key: int) -> int:
        """An object's value."""
        return self.context.dictionary.integer(key)

    def soft_limits(self) -> tuple[int, int]:
        """Lowest and highest target [units]; 0x607D is relative to the home position."""
        low, high = self.integer(o.SOFT_LIMIT_LOW), self.integer(o.SOFT_LIMIT_HIGH)
        if low >= high:
            return -(1 << 31), (1 << 31) - 1
        offset = self.integer(o.HOME_OFFSET)
        return low - offset, high - offset


_TARGET, _OFFSET = o.TARGET_POSITION, o.TORQUE_OFFSET


class CyclicPosition(Mode):
    """csp (8): bit 12 says that the drive follows the command value."""

    ticking = False

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._command = context.motor.command
        self._values = context.dictionary.values
        self._last = self._before = 0
        self.configure()

    def configure(self) -> None:
        """Read limits and interpolation time from the dictionary."""
        self._low, self._high = self.soft_limits()
        self._force_limit = self.integer(o.MAX_TORQUE)
        seconds = self.integer(o.INTERPOLATION_VALUE) * 10.0 ** self.integer(o.INTERPOLATION_INDEX)
        self._ticks = max(1, round(seconds * 1e9 / self.context.motor.tick_ns))

    def start(self) -> None:
        """Follow from the next SYNC on."""
        self.configure()
        motor = self.context.motor
        self._last = self._before = motor.to_drive(motor.demand())
        self.set_bits(0)

    def velocity(self) -> float:
        """Velocity of the demand [m/s]."""
        if self.halted:
            return super().velocity()
        period = self._ticks * self.context.motor.tick_ns * 1e-9
        return (self._last - self._before) * self.context.motor.unit / period

    def halt(self, deceleration: float) -> None:
        """Brake; setpoints are ignored meanwhile."""
        generator = self.context.generator
        generator.take_over(self.context.motor.demand(), self.velocity())
        super().halt(deceleration)
        self.set_bits(self.bits & ~(MODE_BIT_12 | INTERNAL_LIMIT))

    def resume(self) -> None:
        """Follow again, from where the demand is at rest."""
        super().resume()
        self.start()

    def on_sync(self) -> None:
        """Take over target and force offset of this SYNC."""
        if self.halted:
            return
        values, limit = self._values, self._force_limit
        target: int = values[_TARGET]  # type: ignore[assignment]
        force: int = values[_OFFSET]  # type: ignore[assignment]
        if self._low <= target <= self._high:
            bits = MODE_BIT_12
        else:
            target = min(max(target, self._low), self._high)
            bits = INTERNAL_LIMIT
        if not -limit <= force <= limit:
            force = limit if force > 0 else -limit
        self._before = self._last
        self._last = target
        self._command(target, force, self._ticks)
        if bits != self.bits:
            self.set_bits(bits)


class CyclicTorque(CyclicPosition):
    """cst (10)."""

    def velocity(self) -> float:
        """Velocity of the axis [m/s]: no demand is moving."""
        if self.halted:
            return super().velocity()
        motor = self.context.motor
        return motor.velocity() * motor.speed_unit

    def on_sync(self) -> None:
        """Take over the force of this SYNC."""
        if self.halted:
            return
        wanted = self.integer(o.TARGET_TORQUE) + self.integer(o.TORQUE_OFFSET)
        force = min(max(wanted, -self._force_limit), self._force_limit)
        self.context.motor.command_force(force)
        bits = MODE_BIT_12 if force == wanted else INTERNAL_LIMIT
        self.set_bits(bits)
