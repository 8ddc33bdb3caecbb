"""The virtual CiA 402 drive: what a direct-drive axis looks like from the bus.

Puts together dictionary, SDO server, NMT, errors, process data, power state machine and modes.
No input or output of its own: frames come from and go to a `CanSegment`, the mechanics are a
`PlantPort`. At SYNC k the drive samples for its synchronous TPDOs first and lets the synchronous
RPDOs act afterwards.

Not modelled: mains and brake, current limits other than the loop's peak force, limit switches
other than those of homing, parameters kept over power-off.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from canopen import SdoAbortedError
from canopen.sdo import constants as abort

from hil_sim import objects as o
from hil_sim.dictionary import Dictionary
from hil_sim.emergency import (
    CONNECTION_ABORTED,
    FOLLOWING_ERROR,
    HEARTBEAT_LOST,
    Emergency,
)
from hil_sim.homing import Homing
from hil_sim.modes import (
    MODE_BIT_13,
    TARGET_REACHED,
    TICK_NS,
    Context,
    CyclicPosition,
    Mode,
    ModeCode,
)
from hil_sim.motor import Motor
from hil_sim.nmt import NmtSlave, NmtState
from hil_sim.pdo import PdoEngine
from hil_sim.ports import CanSegment, PlantPort, Timer
from hil_sim.profile import ProfileGenerator
from hil_sim.profile_position import ProfilePosition
from hil_sim.sdo_server import DriveSdoServer
from hil_sim.settings import StageSettings
from hil_sim.state_machine import FAULT_RESET, HALT, Command, State, commanded, decode

_VOLTAGE, _REMOTE = 1 << 4, 1 << 9
_POWERED = (State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION)
_CONFIGURES = (
    o.SOFT_LIMIT_LOW, o.SOFT_LIMIT_HIGH, o.HOME_OFFSET, o.MAX_TORQUE,
    o.INTERPOLATION_VALUE, o.INTERPOLATION_INDEX, o.FOLLOWING_WINDOW, o.FOLLOWING_TIMEOUT,
)  # fmt: skip


class Drive:
    """One node: the drive of `stage.axes[axis]`.

    Args:
        plant: all axes' plant; `axis` is this drive's.
        segment: the bus; the node boots on it at once (`nmt.BOOT_NS` until the boot-up message).
    """

    def __init__(
        self, stage: StageSettings, axis: int, plant: PlantPort, segment: CanSegment
    ) -> None:
        settings = stage.axes[axis]
        self.node_id = settings.node
        self.segment = segment
        self.motor = Motor(plant, axis, stage)
        self.dictionary = Dictionary(self.node_id, o.axis_parameters(settings))
        self.generator = ProfileGenerator(TICK_NS * 1e-9)
        self.state = State.SWITCH_ON_DISABLED
        self._ticks = TICK_NS // self.motor.tick_ns
        self._word = 0  # controlword acted on last, and the state it was acted on in
        self._word_state = State.NOT_READY
        self._sync_id = 0x80
        self._timer: Timer | None = None
        self._after_stop: Callable[[], None] | None = None
        self._power_on_counter = self.motor.origin
        self._sticky = 0
        self._outside_ns: int | None = None
        context = Context(self.dictionary, self.motor, segment, self.generator, self._publish)
        self._modes: dict[int, Mode] = {
            ModeCode.NONE: Mode(context),
            ModeCode.PROFILE_POSITION: ProfilePosition(context),
            ModeCode.HOMING: Homing(context),
            ModeCode.CYCLIC_POSITION: CyclicPosition(context),
        }
        self._mode = self._modes[ModeCode.NONE]
        self._following = False  # csp is active: targets are taken over at SYNC
        self.nmt = NmtSlave(
            self.node_id, self.dictionary, segment, self._on_nmt, self._on_reset, self._on_heartbeat
        )
        self.emergency = Emergency(
            self.dictionary,
            segment,
            lambda: self.nmt.state in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL),
        )
        self.pdo = PdoEngine(self.dictionary, segment, self.emergency.announce)
        self.sdo = DriveSdoServer(self.node_id, self.dictionary, segment)
        self._hook_up()
        self._configure()
        self._publish()
        self.nmt.power_on()

    # Dictionary ------------------------------------------------------------------------------

    def _hook_up(self) -> None:
        d, motor = self.dictionary, self.motor
        d.live[o.POSITION_ACTUAL] = motor.position
        d.live[o.TORQUE_ACTUAL] = motor.force
        d.live[o.VELOCITY_ACTUAL] = motor.velocity
        d.live[o.TORQUE_DEMAND] = motor.force
        d.live[o.POSITION_INTERNAL] = lambda: motor.counter() - self._power_on_counter
        d.live[o.POSITION_DEMAND] = lambda: motor.to_drive(motor.demand())
        d.live[o.FOLLOWING_ERROR] = lambda: motor.to_drive(motor.demand()) - motor.position()
        d.on_write[o.CONTROLWORD] = self._on_controlword
        d.on_write[o.MODE] = self._on_mode
        d.check[o.MODE] = self._check_mode
        d.check[o.SYNC_COB_ID] = self._check_sync
        d.on_write[o.SYNC_COB_ID] = lambda _: self._subscribe(self.nmt.state)
        for key in _CONFIGURES:
            d.on_write[key] = lambda _: self._configure()

    def _check_mode(self, value: int) -> None:
        if value not in self._modes:
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)

    def _check_sync(self, value: int) -> None:
        if value & ~0x7FF or not 0x080 <= value <= 0x57F:  # bit 30: we produce no SYNC
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)

    def _configure(self) -> None:
        window = self.dictionary.integer(o.FOLLOWING_WINDOW)
        self._window = math.inf if window == o.OFF else float(window)
        self._timeout_ns = self.dictionary.integer(o.FOLLOWING_TIMEOUT) * 1_000_000
        self._mode.configure()

    # Bus -------------------------------------------------------------------------------------

    def _subscribe(self, state: NmtState) -> None:
        segment = self.segment
        segment.unsubscribe(self._sync_id, self._on_sync)
        segment.unsubscribe(0x600 + self.node_id, self._on_sdo)
        if state is NmtState.OPERATIONAL:
            self._sync_id = self.dictionary.integer(o.SYNC_COB_ID)
            segment.subscribe(self._sync_id, self._on_sync)
        if state in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL):
            segment.subscribe(0x600 + self.node_id, self._on_sdo)

    def _on_nmt(self, new: NmtState, old: NmtState) -> None:
        self._subscribe(new)
        self.sdo.reset()
        if new is NmtState.OPERATIONAL:
            self.pdo.start()
        elif old is NmtState.OPERATIONAL:
            self.pdo.stop()
        if new is NmtState.STOPPED:
            self._connection_lost(CONNECTION_ABORTED)
        self._publish()

    def _on_reset(self, application: bool) -> None:
        self.motor.advance_to(self.segment.now_ns)
        if not application:
            self._connection_lost(CONNECTION_ABORTED)
            self.dictionary.reset_communication()
            return
        self._power_off(State.SWITCH_ON_DISABLED)
        self.dictionary.reset_all()
        self.emergency.reset()
        self.motor.origin = self._power_on_counter = self.motor.counter()
        self._mode = self._modes[ModeCode.NONE]
        self._word, self._word_state, self._sticky = 0, State.NOT_READY, 0
        self._configure()
        self._publish()

    def _on_sdo(self, data: bytes) -> None:
        self.motor.advance_to(self.segment.now_ns)
        self.sdo.on_frame(data)

    def _on_sync(self, _: bytes) -> None:
        self.motor.advance_to(self.segment.now_ns)
        pdo = self.pdo
        pdo.on_sync()
        pdo.latch()
        if self._following:
            self._mode.on_sync()
            self._supervise()

    def _on_heartbeat(self, _: int, alive: bool) -> None:
        self.motor.advance_to(self.segment.now_ns)
        if alive:
            if self.state not in (State.FAULT, State.FAULT_REACTION):
                self.emergency.clear(HEARTBEAT_LOST)
            return
        self.emergency.raise_(HEARTBEAT_LOST)
        self._connection_lost(HEARTBEAT_LOST)
        behavior = self.dictionary.integer(o.ERROR_BEHAVIOR)
        if behavior == 0 and self.nmt.state is NmtState.OPERATIONAL:
            self.nmt.enter(NmtState.PRE_OPERATIONAL)
        elif behavior == 2:
            self.nmt.enter(NmtState.STOPPED)

    def _connection_lost(self, code: int) -> None:
        """0x6007: heartbeat lost, NMT stopped or reset."""
        if self.state is not State.ENABLED:
            return
        option = self.dictionary.integer(o.ABORT_CONNECTION)
        if option == 1:
            if code != HEARTBEAT_LOST:  # which was announced already
                self.emergency.raise_(code)
            self._react_to_fault()
        elif option == 2:
            self._power_off(State.SWITCH_ON_DISABLED)
        elif option == 3:
            self._go(State.QUICK_STOP)

    # Power states ----------------------------------------------------------------------------

    def _on_controlword(self, word: int) -> None:
        if word == self._word and self.state is self._word_state:
            return
        before, self._word = self._word, word
        if self.state is State.FAULT:
            if word & FAULT_RESET and not before & FAULT_RESET:
                self._sticky = 0
                self.emergency.clear()
                self.state = State.SWITCH_ON_DISABLED
        else:
            self._command(word)
        if self.state is State.ENABLED and self._after_stop is None:
            self._on_halt(bool(word & HALT))
            self._mode.on_controlword(word, before)
        self._word_state = self.state
        self._publish()

    def _command(self, word: int) -> None:
        stopping = self._after_stop is not None
        if stopping and self.state is State.ENABLED:
            # on the way out by a ramp: only what is quicker still counts
            if decode(word) not in (Command.DISABLE_VOLTAGE, Command.QUICK_STOP):
                return
        elif stopping and decode(word) is not Command.DISABLE_VOLTAGE:
            return
        option = self.dictionary.integer(o.QUICK_STOP_OPTION)
        new = commanded(self.state, word, option)
        if new is not self.state:
            self._go(new)

    def _go(self, new: State) -> None:
        integer = self.dictionary.integer
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
        motor = self.motor
        self.dictionary.values[o.TORQUE_OFFSET] = 0
        self._outside_ns = None
        if self.state is not State.QUICK_STOP:
            motor.power(True)
            motor.worst_following_error()  # forget what was before
        self.generator.take_over(motor.demand(), 0.0)
        self.state = State.ENABLED
        self._mode.halted = False
        self._mode.start()
        self._arm()

    def _power_off(self, state: State) -> None:
        if self.state in _POWERED:
            self.motor.power(False)
            self.dictionary.values[o.TORQUE_OFFSET] = 0
        self.state = state
        self._after_stop = None
        self._mode.bits = 0
        self._mode.halted = False
        self._arm()
        self._publish()

    def _brake(self, ramp: int, then: Callable[[], None]) -> None:
        """Controlled stop with the deceleration of object `ramp`; the force offset goes to 0."""
        if self._following:
            self.generator.take_over(self.motor.demand(), self._mode.velocity())
        self.dictionary.values[o.TORQUE_OFFSET] = 0
        self.generator.stop(max(1, self.dictionary.integer(ramp)) * 1e-6)
        self._after_stop = then
        self._mode.bits &= ~TARGET_REACHED
        self._arm()

    def _end_stop(self) -> None:
        """Go on to what follows the stop, if the demand is at rest."""
        if self.generator.done:
            then, self._after_stop = self._after_stop, None
            if then is not None:
                then()
            self._publish()

    def _fault(self, code: int) -> None:
        self.emergency.raise_(code)
        self._react_to_fault()

    def _react_to_fault(self) -> None:
        """Transition 13 and 14: by 0x605E, then force off and FAULT."""
        if self.state in (State.FAULT_REACTION, State.FAULT):
            return
        option = self.dictionary.integer(o.FAULT_OPTION)
        if self.state not in _POWERED or option == 0:
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
            quick = self.dictionary.integer(o.HALT_OPTION) != 1
            ramp = o.QUICK_STOP_DECELERATION if quick else o.PROFILE_DECELERATION
            mode.halt(max(1, self.dictionary.integer(ramp)) * 1e-6)
            self._arm()
        elif not halt and mode.halted:
            mode.resume()
            self._arm()

    def _on_mode(self, value: int) -> None:
        new = self._modes[value]
        if new is self._mode:
            return
        if self.state is State.ENABLED and self._after_stop is None:
            if self._following:
                self.generator.take_over(self.motor.demand(), self._mode.velocity())
            self.generator.stop(max(1, self.dictionary.integer(o.PROFILE_DECELERATION)) * 1e-6)
            self.dictionary.values[o.TORQUE_OFFSET] = 0
            new.halted = self._mode.halted
            self._mode = new
            new.start()
        else:
            self._mode = new
            new.bits = 0
            new.halted = False
        self.dictionary.values[o.MODE_DISPLAY] = value
        self._configure()
        self._arm()
        self._publish()
        self.pdo.on_event()

    # Motion ----------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Decide what drives the demand now: SYNC in csp, the tick otherwise, or nothing."""
        stopping = self._after_stop is not None
        enabled = self.state is State.ENABLED and not stopping
        cyclic = not self._mode.ticking and not self._mode.halted
        following, self._following = self._following, enabled and cyclic
        if following and self.state in _POWERED and not self._following:
            # Begins at once, and takes the force offset out, also when there is no way to brake.
            self.motor.command_true(self.generator.step(), self._ticks)
        ticking = self.state in _POWERED and not self._following
        if ticking and self._timer is None:
            self._timer = self.segment.at(self.segment.now_ns + TICK_NS, self._on_tick)
        elif not ticking and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _step(self) -> None:
        if not self.generator.done:
            self.motor.command_true(self.generator.step(), self._ticks)

    def _on_tick(self) -> None:
        now = self.segment.now_ns
        self.motor.advance_to(now)
        self._timer = self.segment.at(now + TICK_NS, self._on_tick)
        if self._after_stop is None and self.state is State.ENABLED:
            self._mode.tick()
            self._step()
        elif self.generator.done:
            self._end_stop()
        else:
            self._step()
        if self.state in _POWERED:
            self._supervise()

    def _supervise(self) -> None:
        if self.motor.worst_following_error() <= self._window:
            self._outside_ns = None
            return
        if self.state is State.FAULT_REACTION:
            return
        now = self.segment.now_ns
        if self._outside_ns is None:
            self._outside_ns = now
        if now - self._outside_ns >= self._timeout_ns:
            self._sticky = MODE_BIT_13
            self._fault(FOLLOWING_ERROR)

    # Statusword ------------------------------------------------------------------------------

    def _publish(self) -> None:
        """Renew the statusword; a change is an event for TPDOs."""
        word = self.state.value | _VOLTAGE | self._sticky
        if self.nmt.state is NmtState.OPERATIONAL or self.nmt.state is NmtState.PRE_OPERATIONAL:
            word |= _REMOTE
        if self.state is State.ENABLED:
            word |= self._mode.bits
        elif self.state is State.QUICK_STOP and self._after_stop is None:
            word |= TARGET_REACHED
        if word != self.dictionary.values[o.STATUSWORD]:
            self.dictionary.values[o.STATUSWORD] = word
            self.pdo.on_event()
