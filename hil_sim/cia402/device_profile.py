"""The device profile of a drive (CiA 402): power states, modes of operation, stops, faults.

The controlword acts when it is written, by SDO or PDO. Option codes select how the axis stops:

- quick stop (0x605A), fault (0x605E): 0 force off at once; 1 the ramp 0x6084; 2 and up the ramp
  0x6085, as this drive has no stop at the current limit. Quick stop also 5 and up: as 1 and up, but
  the drive stays in QUICK STOP ACTIVE
- shutdown (0x605B), disable operation (0x605C): 1 the ramp 0x6084; all others force off at once
- halt (0x605D): 1 the ramp 0x6084; all others the ramp 0x6085
- lost host (0x6007): 0 nothing, 1 a fault, 2 force off, 3 quick stop

Faults that arise by themselves are a lost host (0x6007) and those of `supervision`. Any other, such
as a lost encoder, is injected (`Drive.inject_fault`). Safe torque off removes the force and holds
the drive in SWITCH ON DISABLED while it is active: statusword bit 4 is 0, 0x60FD bit 3 is 1.

Not modelled: current limits other than the loop's peak force.
"""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.cia301 import Dictionary, Emergency
from hil_sim.cia301 import emergency as emcy
from hil_sim.cia402 import objects as o
from hil_sim.cia402.brake import Brake
from hil_sim.cia402.demand import DemandSource
from hil_sim.cia402.mode_selector import ModeSelector
from hil_sim.cia402.modes import MODE_BIT_13, TARGET_REACHED, Context
from hil_sim.cia402.state_machine import FAULT_RESET, HALT, Command, State, decode, next_state
from hil_sim.cia402.supervision import Supervision
from hil_sim.plant import Motor
from hil_sim.ports import CanSegment

_VOLTAGE, _IN_SYNC, _REMOTE = 1 << 4, 1 << 8, 1 << 9
_POWERED = (State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION)
_CONFIGURES = (
    o.SOFT_LIMIT_LOW, o.SOFT_LIMIT_HIGH, o.HOME_OFFSET, o.MAX_TORQUE,
    o.INTERPOLATION_VALUE, o.INTERPOLATION_INDEX, o.FOLLOWING_WINDOW, o.FOLLOWING_TIMEOUT,
)  # fmt: skip


class MotionControl:
    """Power state, mode of operation and faults of one axis.

    Args:
        advance_to: brings the plant to a time [ns].
        on_event: called after a change of the statusword or the mode display.

    Attributes:
        state: CiA 402 state.
        following: a cyclic mode is active: `on_sync` is due at each SYNC.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        motor: Motor,
        segment: CanSegment,
        emergency: Emergency,
        advance_to: Callable[[int], None],
        on_event: Callable[[], None],
    ) -> None:
        self.state = State.SWITCH_ON_DISABLED
        self.following = False
        self._dictionary = dictionary
        self._motor = motor
        self._worst_following_error = motor.worst_following_error
        self._segment = segment
        self._emergency = emergency
        self._advance_to = advance_to
        self._on_event = on_event
        self._remote = False
        self._word = 0  # controlword acted on last, and the state it left the drive in
        self._word_state = State.NOT_READY
        self._in_sync = _IN_SYNC if motor.settings.habits.in_sync else 0
        self._latched_bits = 0  # of the statusword, until the fault is reset
        self._syncs = 0
        self._lasting_faults: set[int] = set()
        self._torque_off = False
        self._demand = DemandSource(motor, segment, advance_to, self._on_tick)
        self._supervision = Supervision(
            dictionary, motor, segment, self.raise_fault, self._on_following_error,
            lambda: self.state is State.FAULT_REACTION,
        )  # fmt: skip
        self._context = Context(
            dictionary, motor, segment, self._demand.generator, self._update_statusword
        )
        self._modes = ModeSelector(
            self._context, self._demand, lambda: self._mode_is_active, self._on_mode_change
        )
        self._holding_brake = Brake(dictionary, lambda: self.state in _POWERED)
        dictionary.act_last = o.ACT_LAST
        dictionary.on_write[o.CONTROLWORD] = self._on_controlword
        for key in _CONFIGURES:
            dictionary.on_write[key] = lambda _: self._configure()
        self._configure()
        self._update_statusword()

    def set_remote(self, remote: bool) -> None:
        """Set statusword bit 9: the bus can reach the controlword."""
        self._remote = remote
        self._update_statusword()

    def on_sync(self) -> None:
        """Take over the setpoints of this SYNC; only while `following`."""
        self._modes.current.on_sync()
        self._supervision.check_following(self._worst_following_error())
        self._syncs += 1
        if not self._syncs & 7:  # every eighth SYNC is soon enough for an end switch
            self._supervision.check_travel()

    def switch_off(self) -> None:
        """Take the force off before the application is reset."""
        self._power_off(State.SWITCH_ON_DISABLED)

    def reset(self) -> None:
        """Return to the state after power-on; the dictionary has been reset already."""
        self._modes.reset()
        self._word, self._word_state, self._latched_bits = 0, State.NOT_READY, 0
        self._supervision.reset_force()
        self._configure()
        self._update_statusword()

    def digital_inputs(self) -> int:
        """0x60FD: bits 0 and 1 the end switches, bit 3 safe torque off."""
        return self._supervision.end_switches() | self._torque_off << 3

    def _configure(self) -> None:
        self._supervision.configure()
        self._modes.current.configure()

    # Faults ----------------------------------------------------------------------------------

    def raise_fault(self, code: int) -> None:
        """Announce a fault and react to it; without effect if the drive is in a fault already."""
        if self.state in (State.FAULT_REACTION, State.FAULT):
            return
        self._advance_to(self._segment.now_ns)
        self._emergency.raise_(code)
        self._react_to_fault(coast=code in emcy.COASTING_FAULTS)

    def raise_lasting_fault(self, code: int) -> None:
        """Raise a fault that cannot be reset before `end_lasting_fault`."""
        self._lasting_faults.add(code)
        self.raise_fault(code)
        self._update_statusword()

    def end_lasting_fault(self, code: int | None) -> None:
        """Remove the cause of a lasting fault (None: of all); the drive stays in FAULT."""
        self._lasting_faults = set() if code is None else self._lasting_faults - {code}
        self._update_statusword()

    def repeat_lasting_faults(self) -> None:
        """After a boot, raise the lasting faults again whose cause is still there."""
        for code in sorted(self._lasting_faults):
            self.raise_fault(code)

    def on_connection_lost(self, code: int) -> None:
        """React to a lost host by 0x6007: heartbeat or setpoints lost, NMT stop or reset."""
        if self.state is not State.ENABLED:
            return
        self._advance_to(self._segment.now_ns)
        option = self._dictionary.integer(o.ABORT_CONNECTION)
        if option == 1:
            if code != emcy.HEARTBEAT_LOST:  # that one has been announced
                self._emergency.raise_(code)
            self._react_to_fault()
        elif option == 2:
            self._power_off(State.SWITCH_ON_DISABLED)
        elif option == 3:
            self._enter(State.QUICK_STOP)

    def set_safe_torque_off(self, active: bool) -> None:
        """Set the STO input. It raises no fault, and the drive stays off when it is released."""
        self._advance_to(self._segment.now_ns)
        self._torque_off = active
        if active:
            faulty = self.state in (State.FAULT, State.FAULT_REACTION)
            self._power_off(State.FAULT if faulty else State.SWITCH_ON_DISABLED)
        self._update_statusword()

    def _react_to_fault(self, coast: bool = False) -> None:
        """Transitions 13 and 14: stop by 0x605E or `coast`, then force off and FAULT."""
        option = self._dictionary.integer(o.FAULT_OPTION)
        if self.state not in _POWERED or option == 0 or coast:
            self._power_off(State.FAULT)
            return
        self._stop(option, lambda: self._power_off(State.FAULT))
        self.state = State.FAULT_REACTION
        self._select_demand_source()
        self._demand.end_stop()
        self._update_statusword()

    def _on_following_error(self) -> None:
        self._latched_bits = MODE_BIT_13
        self.raise_fault(emcy.FOLLOWING_ERROR)

    # Power states ----------------------------------------------------------------------------

    def _on_controlword(self, word: int) -> None:
        if word == self._word and self.state is self._word_state:
            return
        self._advance_to(self._segment.now_ns)
        before, self._word = self._word, word
        if self.state is State.FAULT:
            rising_edge = word & FAULT_RESET and not before & FAULT_RESET
            if rising_edge and not self._lasting_faults:
                self._latched_bits = 0
                self._emergency.clear()
                self.state = State.SWITCH_ON_DISABLED
        elif not self._torque_off:
            self._command(word)
        if self._mode_is_active:
            self._on_halt(bool(word & HALT))
            self._modes.current.on_controlword(word, before)
        self._word_state = self.state
        self._update_statusword()

    def _command(self, word: int) -> None:
        if self._demand.stopping:  # only a quicker stop counts
            quicker = {Command.DISABLE_VOLTAGE}
            if self.state is State.ENABLED:
                quicker.add(Command.QUICK_STOP)
            if decode(word) not in quicker:
                return
        new = next_state(self.state, word, self._dictionary.integer(o.QUICK_STOP_OPTION))
        if new is not self.state:
            self._enter(new)

    def _enter(self, new: State) -> None:
        if new is State.ENABLED:
            self._enable()
        elif new is State.QUICK_STOP:
            self._quick_stop()
        elif self.state is State.ENABLED and new in (State.SWITCHED_ON, State.READY):
            key = o.DISABLE_OPTION if new is State.SWITCHED_ON else o.SHUTDOWN_OPTION
            if self._dictionary.integer(key) == 1:
                self._stop(1, lambda: self._power_off(new))
                self._demand.end_stop()
                self._update_statusword()
            else:
                self._power_off(new)
        elif self.state in _POWERED:
            self._power_off(new)
        else:
            self.state = new

    def _enable(self) -> None:
        self._dictionary.values[o.TORQUE_OFFSET] = 0
        self._supervision.reset_following()
        self._holding_brake.take_control()
        if self.state is not State.QUICK_STOP:
            self._motor.power(True)
            self._worst_following_error()  # forget what was before
        self._demand.take_over(0.0)
        self.state = State.ENABLED
        self._modes.current.halted = False
        self._modes.current.start()
        self._select_demand_source()

    def _quick_stop(self) -> None:
        option = self._dictionary.integer(o.QUICK_STOP_OPTION)
        if option == 0:
            self._power_off(State.SWITCH_ON_DISABLED)
            return
        # Also at rest the state lasts until the next tick, so that a host can see it.
        if option >= 5:  # stays in QUICK STOP ACTIVE
            self._stop(option - 4, lambda: None)
        else:
            self._stop(option, lambda: self._power_off(State.SWITCH_ON_DISABLED))
        self.state = State.QUICK_STOP

    def _power_off(self, state: State) -> None:
        if self.state in _POWERED:
            self._motor.power(False)
            self._dictionary.values[o.TORQUE_OFFSET] = 0
        self.state = state
        self._demand.abandon_stop()
        self._modes.current.bits = 0
        self._modes.current.halted = False
        self._select_demand_source()
        self._update_statusword()

    def _deceleration(self, option: int) -> float:
        """Of an option code: 1 the profile's, else the quick stop's [m/s^2]."""
        return self._context.rate(
            o.PROFILE_DECELERATION if option == 1 else o.QUICK_STOP_DECELERATION
        )

    def _stop(self, option: int, then: Callable[[], None]) -> None:
        """Stop by an option code other than 0; the force offset goes to 0."""
        if self.following:
            self._demand.take_over(self._modes.current.velocity())
        self._dictionary.values[o.TORQUE_OFFSET] = 0
        self._demand.stop(self._deceleration(option), then)
        self._modes.current.bits &= ~TARGET_REACHED
        self._select_demand_source()

    # Modes -----------------------------------------------------------------------------------

    @property
    def _mode_is_active(self) -> bool:
        return self.state is State.ENABLED and not self._demand.stopping

    def _on_mode_change(self) -> None:
        self._configure()
        self._select_demand_source()
        self._update_statusword()
        self._on_event()

    def _on_halt(self, halt: bool) -> None:
        if halt is self._modes.current.halted:
            return
        if halt:
            self._modes.current.halt(self._deceleration(self._dictionary.integer(o.HALT_OPTION)))
        else:
            self._modes.current.resume()
        self._select_demand_source()

    def _select_demand_source(self) -> None:
        mode = self._modes.current
        self.following = self._mode_is_active and not mode.ticking and not mode.halted
        self._demand.select(self.state in _POWERED, self.following)

    def _on_tick(self) -> None:
        demand = self._demand
        if demand.stopping and demand.generator.done:
            demand.end_stop()
            self._update_statusword()
        else:
            if self._mode_is_active:
                self._modes.current.tick()
            demand.step()
        if self.state in _POWERED:
            self._supervision.check_following(self._worst_following_error())
            self._supervision.check_travel()

    def _update_statusword(self) -> None:
        """Write the statusword; a change is an event for TPDOs."""
        word = self.state.value | self._latched_bits
        if emcy.UNDER_VOLTAGE not in self._lasting_faults and not self._torque_off:
            word |= _VOLTAGE
        if self._remote:
            word |= _REMOTE | self._in_sync
        if self.state is State.ENABLED:
            word |= self._modes.current.bits
        elif self.state is State.QUICK_STOP and not self._demand.stopping:
            word |= TARGET_REACHED
        if word != self._dictionary.values[o.STATUSWORD]:
            self._dictionary.values[o.STATUSWORD] = word
            self._on_event()
