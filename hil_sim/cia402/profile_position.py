"""Profile position (pp): the set-point handshake and the drive's own profile.

Write 0x607A, raise controlword bit 4; the drive takes it and raises statusword bit 12; lower bit
4, and bit 12 falls when the drive can take another. Bit 5: at once, else one set-point waits for
the present one to end; bit 6: relative to the target before. With bit 9 and without bit 5 the
present target is passed at its own profile velocity, where the one that waits lies further on;
where it lies back, there is a stop as without bit 9. At once counts also while one waits, which is
forgotten then. Bit 10 says that the position is within 0x6067 of the target for 0x6068.
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
    """A target with the profile parameters it was given with.

    Attributes:
        target: [nm], inside the soft limits.
        clipped: it was asked for beyond them.
        passing: the target before is passed without a stop.
        speed, acceleration, deceleration, jerk: SI units, jerk None: not limited.
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
        self._passing = 0  # direction in which the target is passed, 0: there is a stop

    def start(self) -> None:
        """Rest (or come to rest) where the demand is; that is the target."""
        motor = self.context.motor
        self._active = self._waiting = None
        self._passing = 0
        self._target = motor.to_drive(motor.demand())
        self._inside_ns = None
        self.set_bits(0)

    def on_controlword(self, word: int, before: int) -> None:
        """Handshake of bit 4."""
        if word & NEW_SETPOINT and not before & NEW_SETPOINT:
            at_once = bool(word & IMMEDIATELY)
            if self.bits & ACKNOWLEDGE and not at_once:
                return  # both places are taken
            self._take(at_once, bool(word & RELATIVE), bool(word & PASSING))
        elif not word & NEW_SETPOINT and self._waiting is None:
            self.set_bits(self.bits & ~ACKNOWLEDGE)

    def tick(self) -> None:
        """Next set-point, target reached."""
        super().tick()
        if self.halted:
            return
        done = self.context.generator.done
        if self._waiting is not None and (done or self._passed()):
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
        """Go on to the target."""
        super().resume()
        if self._active is not None:
            self._run(self._active)
            self._pass()

    def _take(self, immediately: bool, relative: bool, passing: bool) -> None:
        base = 0
        if relative:
            base = self._target if self._waiting is None else self._waiting.target
        wanted = base + self.integer(o.TARGET_POSITION)
        low, high = self.soft_limits()
        target = min(max(wanted, low), high)
        motor = self.context.motor
        jerk_limited = self.integer(o.PROFILE_TYPE) == JERK_LIMITED
        setpoint = Setpoint(
            target,
            target != wanted,
            passing,
            max(1, self.integer(o.PROFILE_VELOCITY)) * motor.speed_unit,
            max(1, self.integer(o.PROFILE_ACCELERATION)) * motor.rate_unit,
            max(1, self.integer(o.PROFILE_DECELERATION)) * motor.rate_unit,
            max(1, self.integer(o.PROFILE_JERK)) * motor.rate_unit if jerk_limited else None,
        )
        busy = self._active is not None and not self.context.generator.done
        if busy and not immediately:
            self._waiting = setpoint
            if not self.halted:
                self._pass()
            self.set_bits(self.bits | ACKNOWLEDGE)
        else:
            self._waiting = None
            if self.halted:
                self._active = setpoint
                self._target = target
            else:
                self._run(setpoint)
            self.set_bits(self.bits | ACKNOWLEDGE)

    def _pass(self) -> None:
        """Head for the set-point that waits, where that leads on past the present target."""
        active, waiting = self._active, self._waiting
        if active is None or waiting is None or not waiting.passing:
            return
        generator, way = self.context.generator, waiting.target - active.target
        here = self.context.motor.to_drive(generator.position)
        if way * (active.target - here) <= 0:
            return
        self._passing = 1 if way > 0 else -1
        generator.move(
            self.context.motor.to_true(waiting.target),
            active.speed,
            active.acceleration,
            waiting.deceleration,
            active.jerk,
        )

    def _passed(self) -> bool:
        here = self.context.motor.to_drive(self.context.generator.position)
        return self._passing * (here - self._target) > 0

    def _run(self, setpoint: Setpoint) -> None:
        self._active = setpoint
        self._passing = 0
        self._target = setpoint.target
        self._inside_ns = None
        bits = self.bits & ~(TARGET_REACHED | INTERNAL_LIMIT)
        self.set_bits(bits | INTERNAL_LIMIT if setpoint.clipped else bits)
        self.context.generator.move(
            self.context.motor.to_true(setpoint.target),
            setpoint.speed,
            setpoint.acceleration,
            setpoint.deceleration,
            setpoint.jerk,
        )
