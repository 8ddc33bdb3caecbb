"""The virtual drive: a CANopen node (CiA 301) around a CiA 402 axis.

Connects dictionary, SDO server, NMT, EMCY, process data and motion control. It does no input or
output of its own: frames come from and go to a `CanSegment`, the mechanics are a `PlantPort`. At
SYNC k it samples for its synchronous TPDOs first and then lets the synchronous RPDOs act. All
parameters are volatile.
"""

from __future__ import annotations

from canopen.sdo import constants as abort

from hil_sim.cia301 import (
    Dictionary,
    DriveSdoServer,
    Emergency,
    NmtSlave,
    NmtState,
    PdoEngine,
    require,
)
from hil_sim.cia301 import emergency as emcy
from hil_sim.cia402 import MotionControl, State
from hil_sim.cia402 import objects as o
from hil_sim.habitual_objects import adopt, guard
from hil_sim.plant import Motor
from hil_sim.ports import CanSegment, PlantPort
from hil_sim.quirks import OddPosition
from hil_sim.settings import StageSettings

_COMMUNICATING = (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL)
"""NMT states in which SDO and EMCY exist."""


class Drive:
    """One node: the drive of `stage.axes[axis]`.

    Args:
        stage: settings of the whole stage.
        axis: number of this drive's axis in it.
        plant: plant of all axes.
        segment: the bus; the node boots on it at once (`nmt.BOOT_NS` until the boot-up message).
    """

    def __init__(
        self, stage: StageSettings, axis: int, plant: PlantPort, segment: CanSegment
    ) -> None:
        settings = stage.axes[axis]
        self.node_id = settings.node
        self.dictionary = Dictionary(self.node_id, o.axis_parameters(settings))
        habits = settings.habits
        adopt(self.dictionary, habits)
        self.motor = Motor(plant, axis, stage)
        self._odd = None if settings.quirks is None else OddPosition(settings.quirks)
        self._sampled: int | None = None  # at the SYNC being handled, if odd
        self.nmt = NmtSlave(
            self.node_id, self.dictionary, segment, self._on_nmt, self._on_reset, self._on_heartbeat
        )
        self.emergency = Emergency(
            self.dictionary, segment, lambda: self.nmt.state in _COMMUNICATING
        )
        self.pdo = PdoEngine(
            self.dictionary, segment, self.emergency.announce, self._on_setpoints_lost
        )
        self.sdo = DriveSdoServer(self.node_id, self.dictionary, segment, habits.long_answers)
        self.motion = MotionControl(
            self.dictionary,
            self.motor,
            segment,
            self.emergency,
            plant.advance_to,
            self.pdo.on_event,
        )
        self._segment = segment
        self._advance_to = plant.advance_to
        self._sync_id = 0x80
        self._sync_length = 0
        self._sync_reported = False
        self._power_on_counter = self.motor.origin
        self._connect_objects()
        guard(self.dictionary, habits)
        self.nmt.power_on()

    def inject_fault(self, code: int, lasting: bool = False) -> None:
        """Cause a fault of the drive now, announced with this error code (CiA 402).

        The drive reacts by 0x605E, or takes the force off at once if the fault leaves it nothing to
        brake with (`emergency.COASTING_FAULTS`). Without effect in FAULT.

        Args:
            code: EMCY and 0x603F, 0x0001..0xFFFF.
            lasting: the cause remains, and a reset is refused, until `end_fault`; with
                under-voltage the statusword shows no supply (bit 4).

        Raises:
            ValueError: not an error code.
        """
        if not 0 < code <= 0xFFFF:
            raise ValueError(f"error code 0x{code:X} is not in 0x0001..0xFFFF")
        if lasting:
            self.motion.raise_lasting_fault(code)
        else:
            self.motion.raise_fault(code)

    def end_fault(self, code: int | None = None) -> None:
        """Remove the cause of a lasting fault (None: of all), so that it can be reset."""
        self.motion.end_lasting_fault(code)

    def safe_torque_off(self, active: bool) -> None:
        """Set the STO input: force off, and SWITCH ON DISABLED for as long as it is active."""
        self.motion.set_safe_torque_off(active)

    def _connect_objects(self) -> None:
        live, motor = self.dictionary.live, self.motor
        live[o.POSITION_ACTUAL] = motor.position if self._odd is None else self._odd_position
        live[o.TORQUE_ACTUAL] = motor.force
        live[o.VELOCITY_ACTUAL] = motor.velocity
        live[o.TORQUE_DEMAND] = motor.force
        live[o.POSITION_INTERNAL] = lambda: motor.counter() - self._power_on_counter
        live[o.POSITION_DEMAND] = lambda: motor.to_drive(motor.demand())
        live[o.DIGITAL_INPUTS] = self.motion.digital_inputs
        live[o.FOLLOWING_ERROR] = lambda: motor.to_drive(motor.demand()) - motor.position()
        self.dictionary.check[o.SYNC_COB_ID] = self._check_sync
        self.dictionary.check[o.SYNC_OVERFLOW] = self._check_overflow
        self.dictionary.on_write[o.SYNC_OVERFLOW] = self._on_overflow
        self.dictionary.on_write[o.SYNC_COB_ID] = lambda _: self._subscribe(self.nmt.state)

    def _odd_position(self) -> int:
        motor, sampled = self.motor, self._sampled
        return motor.position() if sampled is None else motor.to_position(sampled)

    def _check_sync(self, value: int) -> None:
        # bit 30: the drive produces no SYNC; bit 31 has no meaning
        require(not value & 0x7FFFF800 and 0x080 <= value & 0x7FF <= 0x57F)

    def _subscribe(self, state: NmtState) -> None:
        segment = self._segment
        segment.unsubscribe(self._sync_id, self.on_sync)
        segment.unsubscribe(0x600 + self.node_id, self._on_sdo)
        if state is NmtState.OPERATIONAL:
            self._sync_id = self.dictionary.integer(o.SYNC_COB_ID) & 0x7FF
            segment.subscribe(self._sync_id, self.on_sync)
        if state in _COMMUNICATING:
            segment.subscribe(0x600 + self.node_id, self._on_sdo)

    def _on_nmt(self, new: NmtState, old: NmtState) -> None:
        self._subscribe(new)
        self.sdo.reset()
        if new is NmtState.OPERATIONAL:
            self.pdo.start()
        elif old is NmtState.OPERATIONAL:
            self.pdo.stop()
        if new is NmtState.STOPPED:
            self.motion.on_connection_lost(emcy.CONNECTION_ABORTED)
        self.motion.set_remote(new in _COMMUNICATING)
        if old is NmtState.BOOTING:
            self.motion.repeat_lasting_faults()

    def _on_reset(self, application: bool) -> None:
        self._advance_to(self._segment.now_ns)
        self._on_overflow(0)
        if not application:
            self.motion.on_connection_lost(emcy.CONNECTION_ABORTED)
            self.dictionary.reset_communication()
            return
        self.motion.switch_off()
        self.dictionary.reset_all()
        self.emergency.reset()
        self.motor.origin = self._power_on_counter = self.motor.counter()
        self.motion.reset()

    def _on_sdo(self, data: bytes) -> None:
        self._advance_to(self._segment.now_ns)
        self.sdo.on_frame(data)

    def _check_overflow(self, value: int) -> None:
        require(value != 1 and value <= 240)
        period = self.dictionary.integer(o.CYCLE_PERIOD)
        require(not period, abort.ABORT_APPLICATION_DEVICE_STATE)

    def _on_overflow(self, value: int) -> None:
        """SYNC carries a counter if the value is not 0."""
        self._sync_length = 1 if value else 0
        self._sync_reported = False

    def on_sync(self, data: bytes) -> None:
        """Handle a SYNC: send what is due, then act on the setpoints received before it."""
        if len(data) != self._sync_length:
            if not self._sync_reported:  # once, not at every SYNC
                self._sync_reported = True
                self.emergency.announce(emcy.SYNC_LENGTH)
            return
        self._advance_to(self._segment.now_ns)
        if self._odd is None:
            self.pdo.on_sync()
        else:
            self._sampled = self._odd.sample(self.motor.counter(), self._segment.now_ns)
            self.pdo.on_sync()
            self._sampled = None
        motion = self.motion
        if motion.following:
            motion.on_sync()

    def _on_setpoints_lost(self) -> None:
        """React by 0x6007, as to a lost host; the EMCY tells the two apart."""
        faults = self.dictionary.integer(o.ABORT_CONNECTION) == 1
        if not (faults and self.motion.state is State.ENABLED):  # else the fault announces it
            self.emergency.announce(emcy.RPDO_TIMEOUT)
        self.motion.on_connection_lost(emcy.RPDO_TIMEOUT)

    def _on_heartbeat(self, _: int, alive: bool) -> None:
        if alive:
            if self.motion.state not in (State.FAULT, State.FAULT_REACTION):
                self.emergency.clear(emcy.HEARTBEAT_LOST)
            return
        self.emergency.raise_(emcy.HEARTBEAT_LOST)
        self.motion.on_connection_lost(emcy.HEARTBEAT_LOST)
        behavior = self.dictionary.integer(o.ERROR_BEHAVIOR)
        if behavior == 0 and self.nmt.state is NmtState.OPERATIONAL:
            self.nmt.enter(NmtState.PRE_OPERATIONAL)
        elif behavior == 2:
            self.nmt.enter(NmtState.STOPPED)
