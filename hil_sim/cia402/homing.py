"""Homing (hm): index pulse of the encoder, or the present position (methods 33, 34, 35, 37).

33 and 34 search for the index mark in negative and positive direction at 0x6099:01 and reverse once
beyond the range switches (0x2004:01 either side of the mark). After the mark they brake with 0x609A
and return to it at 0x6099:02. The pulse itself latches the counter, so the home position is exact.
Zero is the home position plus 0x607C. Homing starts with the rising edge of controlword bit 4 and
is interrupted when it falls. Statusword bits 13, 12, 10: 000 in progress, 001 not started or
interrupted, 010 attained and moving, 011 done, 100 and 101 error.
"""

from __future__ import annotations

from enum import Enum

from hil_sim.cia402 import objects as o
from hil_sim.cia402.modes import MODE_BIT_12, MODE_BIT_13, TARGET_REACHED, Context, Mode

START = 1 << 4
ATTAINED, ERROR = MODE_BIT_12, MODE_BIT_13

_DIRECTION = {33: -1, 34: 1}
_PRESENT_POSITION = (35, 37)
METHODS = (*_DIRECTION, *_PRESENT_POSITION)
_FAR = 4.0  # [m], beyond any search


class _Phase(Enum):
    IDLE = "idle"
    SEARCH = "search"
    BRAKE = "brake"
    RETURN = "return"
    FAIL = "fail"


class Homing(Mode):
    """hm (6)."""

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._phase = _Phase.IDLE
        self._direction = 1
        self._reversed = False
        self._counter = 0

    def start(self) -> None:
        """Wait for bit 4."""
        self._phase = _Phase.IDLE
        self.set_bits(TARGET_REACHED if self.context.generator.done else 0)

    def on_controlword(self, word: int, before: int) -> None:
        """Start or interrupt homing."""
        if word & START and not before & START:
            self._begin()
        elif before & START and not word & START and self._phase is not _Phase.IDLE:
            self._phase = _Phase.IDLE
            self.context.generator.stop(self._deceleration())
            self.set_bits(0)

    def tick(self) -> None:
        """Check index mark and range switches."""
        super().tick()
        if self.halted:
            return
        counter = self.context.motor.counter()
        passed = (self._counter < 0 <= counter) or (counter <= 0 < self._counter)
        self._counter = counter
        done = self.context.generator.done
        if self._phase is _Phase.SEARCH:
            if passed:
                self._phase = _Phase.BRAKE
                self.context.generator.stop(self._deceleration())
            else:
                self._check_range(counter)
        elif self._phase is _Phase.BRAKE and done:
            self._phase = _Phase.RETURN
            self._go(0.0, o.HOMING_SPEED_INDEX)
        elif self._phase is _Phase.RETURN and done:
            self._set_home(0)
        elif self._phase in (_Phase.IDLE, _Phase.FAIL) and done:
            self._phase = _Phase.IDLE
            self.set_bits(self.bits | TARGET_REACHED)

    def resume(self) -> None:
        """Continue the search or the return."""
        super().resume()
        if self._phase is _Phase.SEARCH:
            self._search()
        elif self._phase is _Phase.RETURN:
            self._go(0.0, o.HOMING_SPEED_INDEX)

    def _begin(self) -> None:
        method = self.integer(o.HOMING_METHOD)
        self._counter = self.context.motor.counter()
        if method in _PRESENT_POSITION:
            self._set_home(self._counter)
        elif method in _DIRECTION:
            self._direction = _DIRECTION[method]
            self._reversed = False
            self._phase = _Phase.SEARCH
            self.set_bits(0)
            if not self.halted:
                self._search()
        else:
            self._fail()

    def _check_range(self, counter: int) -> None:
        beyond = self._direction * counter * self.context.motor.settings.increment
        if beyond <= self.integer(o.INDEX_SEARCH_RANGE) * 1e-9:
            return
        if self._reversed:
            self._fail()
        else:
            self._reversed = True
            self._direction = -self._direction
            self._search()

    def _search(self) -> None:
        here = self.context.generator.position
        self._go(here + self._direction * _FAR, o.HOMING_SPEED_SEARCH)

    def _go(self, target: float, speed_key: int) -> None:
        rate = self._deceleration()
        self.context.generator.move(target, self.context.speed(speed_key), rate, rate)

    def _set_home(self, counter: int) -> None:
        motor = self.context.motor
        offset = self.integer(o.HOME_OFFSET)
        motor.origin = counter + round(offset * motor.unit / motor.settings.increment)
        self._phase = _Phase.IDLE
        attained = ATTAINED if motor.settings.habits.homing_attained else 0
        self.set_bits(attained | (TARGET_REACHED if self.context.generator.done else 0))

    def _fail(self) -> None:
        self._phase = _Phase.FAIL
        self.context.generator.stop(self._deceleration())
        self.set_bits(ERROR)

    def _deceleration(self) -> float:
        return self.context.rate(o.HOMING_ACCELERATION)
