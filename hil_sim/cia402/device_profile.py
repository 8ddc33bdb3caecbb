"""The drive's device profile (CiA 402): power states, modes, controlled stops, following error.

The controlword acts when it is written, by SDO or PDO. What moves the demand is either the SYNC
(csp, csv) or the profile generator, once a millisecond: pp, pv, homing, and every stop. Stops by
the option codes 0x605A to 0x605E and 0x6007: 1 means the ramp 0x6084, 2 and up the ramp 0x6085
(this drive has no stop at the current limit), 0 no ramp.

Faults that come by themselves: a lost host, and what `supervision.py` watches. Encoder and supply
fail only when told to (`Drive.inject_fault`).

Safe torque off takes the force away and the drive to SWITCH ON DISABLED, where it stays as long:
statusword bit 4 is 0, 0x60FD bit 3 is 1. Bits 0 and 1 there are the end switches.

The holding brake (`brake.py`) is set without power and released under it.

Not modelled: current limits other than the loop's peak force.
"""

from __future__ import annotations

from collections.abc import Callable

from canopen import SdoAbortedError
from canopen.sdo import constants as abort

from hil_sim.cia301 import (
    FOLLOWING_ERROR,
    HEARTBEAT_LOST,
    UNDER_VOLTAGE,
    WITHOUT_CONTROL,
    Dictionary,
    Emergency,
)
from hil_sim.cia402 import objects as o
from hil_sim.cia402.brake import Brake
from hil_sim.cia402.homing import Homing
from hil_sim.cia402.modes import (
    MODE_BIT_13,
    TARGET_REACHED,
    TICK_NS,
    Context,
    CyclicPosition,
    Mode,
    ModeCode,
)
from hil_sim.cia402.profile_generator import ProfileGenerator
from hil_sim.cia402.profile_position import ProfilePosition
from hil_sim.cia402.state_machine import FAULT_RESET, HALT, Command, State, commanded, decode
from hil_sim.cia402.supervision import Supervision
from hil_sim.cia402.torque import CyclicTorque
from hil_sim.cia402.velocity import CyclicVelocity, ProfileVelocity
from hil_sim.plant import Motor
from hil_sim.ports import CanSegment, Timer

_VOLTAGE, _REMOTE = 1 << 4, 1 << 9
_POWERED = (State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION)
_CONFIGURES = (
    o.SOFT_LIMIT_LOW, o.SOFT_LIMIT_HIGH, o.HOME_OFFSET, o.MAX_TORQUE,
    o.INTERPOLATION_VALUE, o.INTERPOLATION_INDEX, o.FOLLOWING_WINDOW, o.FOLLOWING_TIMEOUT,
)  # fmt: skip


class MotionControl:
    """Power state, mode and demand of one axis.

    Args:
        advance_to: brings the plant to a time [ns].
        changed: called after a change of the statusword or the mode display.

    Attributes:
        state: CiA 402 state.
        following: csp is active: `on_sync` is to be called at each SYNC.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        motor: Motor,
        segment: CanSegment,
        emergency: Emergency,
        advance_to: Callable[[int], None],
        changed: Callable[[], None],
    ) -> None:
        self.state = State.SWITCH_ON_DISABLED
        self.following = False
        self._dictionary = dictionary
        self._motor = motor
        self._worst_following_error = motor.worst_following_error
        self._segment = segment
        self._emergency = emergency
        self._advance_to = advance_to
        self._changed = changed
        self._remote = False
        self._generator = ProfileGenerator(TICK_NS * 1e-9)
        self._ticks = TICK_NS // motor.tick_ns
        self._word = 0  # controlword acted on last, and the state it left the drive in
        self._word_state = State.NOT_READY
        self._timer: Timer | None = None
        self._due_ns = 0
        self._after_stop: Callable[[], None] | None = None
        self._sticky = 0
        self._syncs = 0
        self._causes: set[int] = set()
        self._torque_off = False
        self._watch = Supervision(
            dictionary, motor, segment, self.fault, self._on_following_error,
            lambda: self.state is State.FAULT_REACTION,
        )  # fmt: skip
        context = Context(dictionary, motor, segment, self._generator, self._publish)
        self._modes: dict[int, Mode] = {
            ModeCode.NONE: Mode(context),
            ModeCode.PROFILE_POSITION: ProfilePosition(context),
            ModeCode.PROFILE_VELOCITY: ProfileVelocity(context),
            ModeCode.HOMING: Homing(context),
            ModeCode.CYCLIC_POSITION: CyclicPosition(context),
            ModeCode.CYCLIC_VELOCITY: CyclicVelocity(context),
            ModeCode.CYCLIC_TORQUE: CyclicTorque(context),
        }
        self._mode = self._modes[ModeCode.NONE]
        self._brake_output = Brake(dictionary, lambda: self.state in _POWERED)
        dictionary.act_last = o.ACT_LAST
        dictionary.on_write[o.CONTROLWORD] = self._on_controlword
        dictionary.on_write[o.MODE] = self._on_mode
        dictionary.check[o.MODE] = self._check_mode
        for key in _CONFIGURES:
            dictionary.on_write[key] = lambda _: self._configure()
        self._configure()
        self._publish()

    def set_remote(self, remote: bool) -> None:
        """Statusword bit 9: the controlword can be reached from the bus."""
        self._remote = remote
        self._publish()

    def on_sync(self) -> None:
        """Take over the setpoints of this SYNC; only while `following`."""
        self._mode.on_sync()
        self._watch.following(self._worst_following_error())
        self._syncs += 1
        if not self._syncs & 7:  # a switch does not run away
            self._watch.travel()

    def switch_off(self) -> None:
        """Force off, before a reset of the application."""
        self._power_off(State.SWITCH_ON_DISABLED)

    def reset(self) -> None:
        """As after power-on; the dictionary was reset already."""
        self._mode = self._modes[ModeCode.NONE]
        self._word, self._word_state, self._sticky = 0, State.NOT_READY, 0
        self._watch.forget_force()
        self._configure()
        self._publish()

    def _check_mode(self, value: int) -> None:
        if value not in self._modes:
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)

    def _configure(self) -> None:
        self._watch.configure()
        self._mode.configure()

    def connection_lost(self, code: int) -> None:
        """0x6007: heartbeat or setpoints lost, NMT stopped or reset."""
        if self.state is not State.ENABLED:
            return
        self._advance_to(self._segment.now_ns)
        option = self._dictionary.integer(o.ABORT_CONNECTION)
        if option == 1:
            if code != HEARTBEAT_LOST:  # which was announced already
                self._emergency.raise_(code)
            self._react_to_fault()
        elif option == 2:
            self._power_off(State.SWITCH_ON_DISABLED)
        elif option == 3:
            self._go(State.QUICK_STOP)

    # Power states ----------------------------------------------------------------------------

    def _on_controlword(self, word: int) -> None:
        if word == self._word and self.state is self._word_state:
            return
        self._advance_to(self._segment.now_ns)
        before, self._word = self._word, word
        if self.state is State.FAULT:
            if word & FAULT_RESET and not before & FAULT_RESET and not self._causes:
                self._sticky = 0
                self._emergency.clear()
                self.state = State.SWITCH_ON_DISABLED
        else:
            self._command(word)
        if self.state is State.ENABLED and self._after_stop is None:
            self._on_halt(bool(word & HALT))
            self._mode.on_controlword(word, before)
        self._word_state = self.state
        self._publish()

    def _command(self, word: int) -> None:
        if self._torque_off:
            return
        stopping = self._after_stop is not None
        if stopping and self.state is State.ENABLED:
            # on the way out by a ramp: only what is quicker still counts
            if decode(word) not in (Command.DISABLE_VOLTAGE, Command.QUICK_STOP):
                return
        elif stopping and decode(word) is not Command.DISABLE_VOLTAGE:
            return
        option = self._dictionary.integer(o.QUICK_STOP_OPTION)
        new = commanded(self.state, word, option)
        if new is not self.state:
            self._go(new)

    def _go(self, new: State) -> None:
        integer = self._dictionary.integer
        if new is State.ENABLED:
            self._enable()
        elif new is State.QUICK_STOP:
            option = integer(o.QUICK_STOP_OPTION)
            if option == 0:
                self._power_off(State.SWITCH_ON_DISABLED)
                return
            stay = option >= 5
            ramp = o.PROFILE_DECELERATION if option in (1, 5) else o.QUICK_STOP_DECELERATION
            # Also at rest the state shows until the next tick, so that a host can see it.
            self._brake(
                ramp, (lambda: None) if stay else lambda: self._power_off(State.SWITCH_ON_DISABLED)
            )
            self.state = new
        elif self.state is State.ENABLED and new in (State.SWITCHED_ON, State.READY):
            option = integer(o.DISABLE_OPTION if new is State.SWITCHED_ON else o.SHUTDOWN_OPTION)
            if option == 1:
                self._brake(o.PROFILE_DECELERATION, lambda: self._power_off(new))
                self._end_stop()
            else:
                self._power_off(new)
        elif self.state in _POWERED:
            self._power_off(new)
        else:
            self.state = new

    def _enable(self) -> None:
        motor = self._motor
        self._dictionary.values[o.TORQUE_OFFSET] = 0
        self._watch.forget_position()
        self._brake_output.take_back()
        if self.state is not State.QUICK_STOP:
            motor.power(True)
            motor.worst_following_error()  # forget what was before
        self._generator.take_over(motor.demand(), 0.0)
        self.state = State.ENABLED
        self._mode.halted = False
        self._mode.start()
        self._arm()

    def _power_off(self, state: State) -> None:
        if self.state in _POWERED:
            self._motor.power(False)
            self._dictionary.values[o.TORQUE_OFFSET] = 0
        self.state = state
        self._after_stop = None
        self._mode.bits = 0
        self._mode.halted = False
        self._arm()
        self._publish()

    def _brake(self, ramp: int, then: Callable[[], None]) -> None:
        """Controlled stop with the deceleration of object `ramp`; the force offset goes to 0."""
        if self.following:
            self._generator.take_over(self._motor.demand(), self._mode.velocity())
        self._dictionary.values[o.TORQUE_OFFSET] = 0
        self._generator.stop(max(1, self._dictionary.integer(ramp)) * self._motor.rate_unit)
        self._after_stop = then
        self._mode.bits &= ~TARGET_REACHED
        self._arm()

    def _end_stop(self) -> None:
        """Go on to what follows the stop, if the demand is at rest."""
        if self._generator.done:
            then, self._after_stop = self._after_stop, None
            if then is not None:
                then()
            self._publish()

    def lasting_fault(self, code: int) -> None:
        """A fault whose cause stays: not to be reset, before `cause_ended`."""
        self._causes.add(code)
        self.fault(code)
        self._publish()

    def cause_ended(self, code: int | None) -> None:
        """The cause of a lasting fault is gone (None: of all); the fault itself stays."""
        self._causes = set() if code is None else self._causes - {code}
        self._publish()

    def safe_torque_off(self, active: bool) -> None:
        """The STO input; what it takes away is not a fault, and nothing comes back by itself."""
        self._advance_to(self._segment.now_ns)
        self._torque_off = active
        if active and self.state not in (State.FAULT, State.FAULT_REACTION):
            self._power_off(State.SWITCH_ON_DISABLED)
        elif active:
            self._power_off(State.FAULT)
        self._publish()

    def digital_inputs(self) -> int:
        """0x60FD: end switches and interlock."""
        return self._watch.switches() | self._torque_off << 3

    def notice_causes(self) -> None:
        """After a boot: causes that are still there are faults again."""
        for code in sorted(self._causes):
            self.fault(code)

    def fault(self, code: int) -> None:
        """A fault of the drive: EMCY and error code, then the reaction; nothing in FAULT."""
        if self.state in (State.FAULT_REACTION, State.FAULT):
            return
        self._advance_to(self._segment.now_ns)
        self._emergency.raise_(code)
        self._react_to_fault(coasts=code in WITHOUT_CONTROL)

    def _react_to_fault(self, coasts: bool = False) -> None:
        """Transition 13 and 14: by 0x605E, then force off and FAULT.

        Args:
            coasts: whatever would brake is gone: force off at once.
        """
        if self.state in (State.FAULT_REACTION, State.FAULT):
            return
        option = self._dictionary.integer(o.FAULT_OPTION)
        if self.state not in _POWERED or option == 0 or coasts:
            self._power_off(State.FAULT)
            return
        ramp = o.PROFILE_DECELERATION if option == 1 else o.QUICK_STOP_DECELERATION
        self._brake(ramp, lambda: self._power_off(State.FAULT))
        self.state = State.FAULT_REACTION
        self._arm()
        self._end_stop()
        self._publish()

    def _on_halt(self, halt: bool) -> None:
        mode = self._mode
        if halt and not mode.halted:
            quick = self._dictionary.integer(o.HALT_OPTION) != 1
            ramp = o.QUICK_STOP_DECELERATION if quick else o.PROFILE_DECELERATION
            mode.halt(max(1, self._dictionary.integer(ramp)) * self._motor.rate_unit)
            self._arm()
        elif not halt and mode.halted:
            mode.resume()
            self._arm()

    def _on_mode(self, value: int) -> None:
        new = self._modes[value]
        if new is self._mode:
            return
        if self.state is State.ENABLED and self._after_stop is None:
            if self.following:
                self._generator.take_over(self._motor.demand(), self._mode.velocity())
            self._generator.stop(
                max(1, self._dictionary.integer(o.PROFILE_DECELERATION)) * self._motor.rate_unit
            )
            self._dictionary.values[o.TORQUE_OFFSET] = 0
            new.halted = self._mode.halted
            self._mode = new
            new.start()
        else:
            self._mode = new
            new.bits = 0
            new.halted = False
        self._dictionary.values[o.MODE_DISPLAY] = value
        self._configure()
        self._arm()
        self._publish()
        self._changed()

    # Motion ----------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Decide what drives the demand now: SYNC in csp, the tick otherwise, or nothing."""
        stopping = self._after_stop is not None
        enabled = self.state is State.ENABLED and not stopping
        cyclic = not self._mode.ticking and not self._mode.halted
        following, self.following = self.following, enabled and cyclic
        if following and self.state in _POWERED and not self.following:
            # Begins at once, and takes the force offset out, also when there is no way to brake.
            self._motor.command_true(self._generator.step(), self._ticks)
        ticking = self.state in _POWERED and not self.following
        if ticking and self._timer is None:
            self._due_ns = self._segment.now_ns + TICK_NS
            self._timer = self._segment.at(self._due_ns, self._on_tick)
        elif not ticking and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _step(self) -> None:
        if not self._generator.done:
            self._motor.command_true(self._generator.step(), self._ticks)

    def _on_tick(self) -> None:
        now = self._segment.now_ns
        self._advance_to(now)
        late = (now - self._due_ns) // TICK_NS  # 0 in virtual time
        self._due_ns += (late + 1) * TICK_NS
        self._timer = self._segment.at(self._due_ns, self._on_tick)
        if late and not self._generator.done:
            for _ in range(late):  # keep the profile's time
                self._generator.step()
            if self._generator.done:  # nobody else commands where it ended
                self._motor.command_true(self._generator.position, self._ticks)
        if self._after_stop is None and self.state is State.ENABLED:
            self._mode.tick()
            self._step()
        elif self._generator.done:
            self._end_stop()
        else:
            self._step()
        if self.state in _POWERED:
            self._watch.following(self._worst_following_error())
            self._watch.travel()

    def _on_following_error(self) -> None:
        self._sticky = MODE_BIT_13
        self.fault(FOLLOWING_ERROR)

    # Statusword ------------------------------------------------------------------------------

    def _publish(self) -> None:
        """Renew the statusword; a change is an event for TPDOs."""
        word = self.state.value | self._sticky
        if UNDER_VOLTAGE not in self._causes and not self._torque_off:
            word |= _VOLTAGE
        if self._remote:
            word |= _REMOTE
        if self.state is State.ENABLED:
            word |= self._mode.bits
        elif self.state is State.QUICK_STOP and self._after_stop is None:
            word |= TARGET_REACHED
        if word != self._dictionary.values[o.STATUSWORD]:
            self._dictionary.values[o.STATUSWORD] = word
            self._changed()
