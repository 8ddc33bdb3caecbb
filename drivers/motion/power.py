"""Power states of all axes, commanded together by the controlwords of their RPDOs.

Every RPDO also carries a target position. Until the axis is enabled it is the actual position, so
that enabling causes no motion.

Source: CiA 402-2, state machine of 0x6040 and 0x6041.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers import objects as od
from drivers.cyclic import Channel, Cycle
from drivers.drive import Command, Control, Mode, State, decode, next_controlword
from drivers.errors import AxisFault, DriverError, RefusedError
from drivers.motion.fault_report import axis_fault
from drivers.motion.standstill import wait_for_rest

TIMEOUT = 2.0
"""For a change of power state that involves no motion [s]."""
HOLDING_TIMEOUT = 1.0
"""Longest wait for an enabled axis to come to rest, for example after homing [s]."""
RINGING_TIMEOUT = 0.3
"""The same for an unpowered axis, whose presliding stiffness may ring for longer [s]."""
SDO_DELAY = 0.02
"""An axis still silent or enabled this long after a quick stop is stopped by SDO as well [s]."""
SILENCE_TIMEOUT = 0.6
"""How long to wait for a silent axis; by then its drive has missed our heartbeat [s]."""
OFFSET_RAMP = 0.05
"""Duration of the ramp of force offsets to 0 before axes are disabled [s]."""

IN_FAULT = "is in fault, to be reset first (stagectl enable --reset)"

_MODE_BITS = int(
    Control.NEW_SETPOINT
    | Control.CHANGE_IMMEDIATELY
    | Control.RELATIVE
    | Control.CHANGE_ON_SETPOINT
    | Control.HALT
)


def _timeout(channel: Channel) -> float:
    """How long the axis may take to become enabled, or to send its first TPDO [s]."""
    return channel.axis.settings.enable_timeout if channel.seen else TIMEOUT


class Power:
    """Takes all axes from one power state to another.

    Attributes:
        channels: one per axis.
        mode: mode of operation set last on all axes, None before the first.
        unconfirmed: axes commanded towards power that have not been seen without it since.
    """

    def __init__(self, cycle: Cycle) -> None:
        self.mode: Mode | None = None
        self.unconfirmed: set[str] = set()
        self._unshown: list[Channel] = []
        self.channels = cycle.channels
        self._cycle, self._period = cycle, cycle.period

    @property
    def enabled(self) -> bool:
        """Whether all axes were last seen in OPERATION ENABLED."""
        return all(c.seen and c.state is State.OPERATION_ENABLED for c in self.channels)

    def set_mode(self, mode: Mode) -> None:
        """Sets the mode of operation of all axes by SDO and waits for it."""
        self._map_targets(mode)
        self._unshown = [c for c in self.channels if not c.axis.set_mode(mode)]
        self.mode = mode

    def _map_targets(self, mode: Mode) -> None:
        for channel in self.channels:
            if channel.axis.map_target(mode):
                channel.use_mappings()
                channel.stand_still()

    def require_enabled(self) -> None:
        """Checks that all axes are in OPERATION ENABLED.

        Raises:
            AxisFault: one is not.
        """
        for channel in self.channels:
            if not channel.seen or channel.state is not State.OPERATION_ENABLED:
                raise AxisFault("the stage is not enabled", axis=channel.axis.name)

    def enter(self, mode: Mode, channels: Sequence[Channel] | None = None) -> None:
        """Enables axes (all by default) in a mode of operation.

        Enabled axes change mode under power: switched off, presliding friction would push them back
        by some 10 um. Where a drive refuses that, all go through SWITCH ON DISABLED.

        Raises:
            AxisFault: an axis faults, or does not become enabled.
        """
        chosen = self.channels if channels is None else channels
        self._cycle.network.pump(0.0)
        self._cycle.clear_alarms()
        if self.change_over(mode, chosen):
            return
        self.switch_off()
        wait_for_rest(self._cycle, RINGING_TIMEOUT)
        self.set_mode(mode)
        self.go(State.OPERATION_ENABLED, chosen)
        unshown, self._unshown = [c for c in self._unshown if c in chosen], []
        for channel in unshown:  # before anything moves
            channel.axis.confirm_mode(mode)
        if unshown:
            self._cycle.sync.resume()

    def change_over(self, mode: Mode, channels: Sequence[Channel]) -> bool:
        """Changes the mode of operation under power and without a jump, where possible.

        Returns:
            False where an axis is not enabled, or its drive refuses.

        Raises:
            AxisFault: an axis faults meanwhile.
        """
        ready = State.OPERATION_ENABLED
        if self.mode is None or not all(c.seen and c.state is ready for c in channels):
            return False
        self.ramp_offsets_out()
        if self.mode is Mode.CYCLIC_SYNC_TORQUE:
            wait_for_rest(self._cycle, HOLDING_TIMEOUT)  # nothing holds the axes in cst
        for channel in self.channels:
            channel.controlword &= ~_MODE_BITS
            if self.mode is Mode.HOMING:  # the zero has changed since the target was sent
                channel.target = channel.position
        self._map_targets(mode)
        self._cycle.sync.resume()
        for _ in range(2):  # the drive has the right 0x607A before it enters the mode
            self._cycle.exchange()
        try:
            self.set_mode(mode)
        except RefusedError:
            return False
        self.go(ready, channels)
        return True

    def go(self, target: State, chosen: Sequence[Channel]) -> None:
        """Takes axes to a power state.

        Raises:
            AxisFault: an axis is in FAULT, or does not reach the state in the time its settings
                allow.
        """
        self.unconfirmed.update(c.axis.name for c in chosen)
        late = chosen[0]
        longest = max(TIMEOUT, *(c.axis.settings.enable_timeout for c in chosen))
        for count, _ in enumerate(self._cycle.cycles(longest), 1):
            waiting = [c for c in chosen if not self._step_towards(target, c)]
            if not waiting:
                return
            late = min(waiting, key=_timeout)
            if count >= round(_timeout(late) / self._period):
                break
        if not late.seen:
            raise self._silence(late)
        raise axis_fault(
            late, f"does not reach {target} within {_timeout(late):g} s (enable_timeout)"
        )

    @staticmethod
    def _step_towards(target: State, channel: Channel) -> bool:
        """Commands the next transition; returns whether the axis is in `target`."""
        if not channel.seen:
            return False
        state = channel.state
        if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            raise axis_fault(channel, IN_FAULT)
        channel.controlword = next_controlword(state, target, channel.controlword)
        if state is not State.OPERATION_ENABLED:
            channel.stand_still()
        return state is target

    @staticmethod
    def _silence(channel: Channel) -> AxisFault:
        return AxisFault(
            f"no process data (TPDO 0x{channel.axis.tpdo_id:03X}) at all: does it answer SYNC?",
            axis=channel.axis.name, obj=od.STATUSWORD,
        )  # fmt: skip

    def reset_faults(self) -> None:
        """Acknowledges the faults of all axes that have one.

        Raises:
            AxisFault: a fault persists, or an axis sends no process data.
        """
        self._cycle.clear_alarms()
        for _ in self._cycle.cycles(TIMEOUT, checked=False):
            waiting = False
            for channel in self.channels:
                if not channel.seen:
                    waiting = True
                    continue
                state = channel.state
                if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
                    waiting = True
                    channel.controlword = next_controlword(
                        state, State.SWITCH_ON_DISABLED, channel.controlword
                    )
                    channel.stand_still()
                elif channel.controlword & Command.FAULT_RESET:
                    channel.controlword = int(Command.DISABLE_VOLTAGE)
                    waiting = True
            if not waiting:
                self._cycle.clear_alarms()
                return
        for channel in self.channels:
            if not channel.seen:
                raise self._silence(channel)
            if channel.state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
                raise axis_fault(channel, "the fault cannot be reset")

    def ramp_offsets_out(self) -> None:
        """Ramps the force offsets of enabled axes to 0 at constant targets."""
        steps = max(1, round(OFFSET_RAMP / self._period))
        start = [c.offset for c in self.channels]
        if not any(start) or not self.enabled:
            return
        self._cycle.sync.resume()
        for step in range(1, steps + 1):
            for channel, offset in zip(self.channels, start, strict=True):
                channel.offset = round(offset * (1 - step / steps))
            self._cycle.exchange()

    def quick_stop(self, timeout: float) -> None:
        """Quick-stops all axes and waits until none is moving under power.

        SDO may get through where setpoints or SYNC do not, so it is tried as well. Silent axes are
        given the time in which their drives miss our heartbeat. An axis that sends process data but
        does not stop may receive our heartbeat and nothing else: the heartbeat is suspended until
        the next boot or reset of faults.

        Raises:
            AxisFault: an axis is still enabled or still stopping after `timeout` [s].
            BusError: the bus fails.
        """
        moving = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
        for channel in self.channels:
            channel.controlword, channel.offset = int(Command.QUICK_STOP), 0
        last: tuple[int, ...] = ()
        given_up = round(SILENCE_TIMEOUT / self._period)
        longest = max(timeout, SILENCE_TIMEOUT)
        for count, _ in enumerate(self._cycle.cycles(longest, checked=False), 1):
            positions = tuple(c.position for c in self.channels)
            still, last = positions == last, positions
            states = [c.state for c in self.channels if c.valid]
            # with option codes 5..8 a drive stays in QUICK STOP ACTIVE: standstill ends the stop
            if not any(
                s in moving and (s is not State.QUICK_STOP_ACTIVE or not still) for s in states
            ):
                if len(states) == len(self.channels) or count >= given_up:
                    self._cycle.network.beats = True
                    return
            if count == round(SDO_DELAY / self._period):
                self._cycle.network.beats = moving[0] not in states
                self.attempt_by_sdo(
                    Command.QUICK_STOP,
                    [c for c in self.channels if not c.valid or c.state is moving[0]],
                )
        for channel in self.channels:
            if channel.valid and channel.state in moving:
                raise AxisFault(
                    f"0x{channel.statusword:04X}: still {channel.state} {timeout:g} s after "
                    "the quick stop",
                    axis=channel.axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def switch_off(self) -> None:
        """Switches the power of all axes off, in any state; faults are not raised.

        Where process data do not confirm it, SDO is tried; axes not confirmed by either stay in
        `unconfirmed`.

        Raises:
            BusError: the bus fails.
        """
        for channel in self.channels:
            channel.controlword, channel.offset = int(Command.DISABLE_VOLTAGE), 0
        off = (State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY_TO_SWITCH_ON)
        for _ in self._cycle.cycles(TIMEOUT, checked=False):
            if all(c.state in off if c.valid else c.missed > 1 for c in self.channels):
                break
        doubtful = [c for c in self.channels if not (c.valid and c.state in off)]
        self.attempt_by_sdo(Command.DISABLE_VOLTAGE, doubtful)
        for channel in self.channels:
            if channel not in doubtful or self._state_by_sdo(channel) in off:
                self.unconfirmed.discard(channel.axis.name)

    def attempt_by_sdo(self, command: Command, channels: Sequence[Channel] | None = None) -> None:
        """Writes a controlword by SDO where the cyclic path fails; errors are ignored.

        Args:
            command: the controlword.
            channels: of the axes, all by default.
        """
        chosen = self.channels if channels is None else channels
        for channel in chosen:
            node = channel.axis.node
            try:
                # a silent node may still receive, but do not wait for its answer again
                write = node.write_unanswered if node.silent else node.write
                write(od.CONTROLWORD, int(command))
            except DriverError:
                continue
        if chosen:
            self._cycle.sync.resume()

    def _state_by_sdo(self, channel: Channel) -> State | None:
        """The power state read by SDO, None where the drive does not answer."""
        if channel.axis.node.silent:
            return None
        try:
            return decode(channel.axis.node.read(od.STATUSWORD))
        except DriverError:
            return None
        finally:
            self._cycle.sync.resume()
