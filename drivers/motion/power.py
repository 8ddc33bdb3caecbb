"""Power states of all axes together, by controlwords in the RPDOs, one SYNC at a time.

A target position goes out with every controlword; until an axis is enabled it follows the actual
position, so that enabling never moves anything.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence

from drivers import objects as od
from drivers.cyclic import Channel, Cycle
from drivers.drive import Command, Control, Mode, State, decode, next_controlword
from drivers.errors import AxisFault, DriverError, NodeError

TIMEOUT = 2.0
"""For a change of power state without motion [s]."""
HOLDING_TIMEOUT = 1.0
"""For the loop to take a following error out after homing [s]."""
RINGING_TIMEOUT = 0.3
"""For an axis without power, which may ring on its presliding stiffness much longer [s]."""
REST_SYNCS = 20
REST_BAND = 50e-9
"""An axis rests when it stays within this band [m] for `REST_SYNCS`."""
UNHEARD = 0.02
"""An axis that is silent or still enabled so long after a quick stop is told by SDO, too [s]."""
GIVEN_UP = 0.6
"""A silent axis is waited for so long; its drive has missed our heartbeat by then [s]."""
OFFSET_RAMP = 0.05
"""Time in which a force offset is taken back before an axis is disabled [s]."""

IN_FAULT = "is in fault, to be reset first (stagectl enable --reset)"

_MODE_BITS = int(
    Control.NEW_SETPOINT
    | Control.CHANGE_IMMEDIATELY
    | Control.RELATIVE
    | Control.CHANGE_ON_SETPOINT
    | Control.HALT
)


def state_of(channel: Channel) -> State:
    """The power state that the axis' last statusword shows."""
    return decode(channel.statusword)


def fault(channel: Channel, what: str) -> AxisFault:
    """An `AxisFault` with the axis' statusword and first emergency; `diagnosis` adds the rest."""
    alarm = channel.axis.node.alarm
    parts = [what] if alarm is None else [what, alarm.cause]
    parts.append(f"statusword 0x{channel.statusword:04X} ({state_of(channel)})")
    return AxisFault(
        "; ".join(parts), axis=channel.axis.name, obj=od.STATUSWORD,
        code=None if alarm is None else alarm.code,
    )  # fmt: skip


def _patience(channel: Channel) -> float:
    """How long the axis may take to be enabled, or to be heard at all [s]."""
    return channel.axis.settings.enable_timeout if channel.seen else TIMEOUT


class Power:
    """Takes all axes from one power state to another.

    Attributes:
        mode: mode of operation that all axes were set to last, None before the first.
        loose: names of axes that were led towards power and have not been seen without it since.
    """

    def __init__(self, cycle: Cycle, period: float) -> None:
        self.mode: Mode | None = None
        self.loose: set[str] = set()
        self._cycle = cycle
        self._period = period

    @property
    def channels(self) -> Sequence[Channel]:
        """One per axis."""
        return self._cycle.channels

    @property
    def enabled(self) -> bool:
        """Whether all axes were in OPERATION ENABLED when last heard."""
        return all(c.seen and state_of(c) is State.OPERATION_ENABLED for c in self.channels)

    def set_mode(self, mode: Mode) -> None:
        """Sets the mode of operation on all axes by SDO, and waits for it."""
        self._aim(mode)
        for channel in self.channels:
            channel.axis.set_mode(mode)
        self.mode = mode

    def _aim(self, mode: Mode) -> None:
        """Maps the targets that the mode takes."""
        for channel in self.channels:
            if channel.axis.aim(mode):
                channel.adapt()
                channel.rest()

    def require_enabled(self) -> None:
        """Raises an `AxisFault` that names the first axis that is not in OPERATION ENABLED."""
        for channel in self.channels:
            if not channel.seen or state_of(channel) is not State.OPERATION_ENABLED:
                raise AxisFault("the stage is not enabled", axis=channel.axis.name)

    def enter(self, mode: Mode, channels: Sequence[Channel] | None = None) -> None:
        """Enables axes (all by default) in a mode of operation.

        Enabled ones change over under power, or presliding would throw them back by some 10 um;
        where a drive refuses that, all go through SWITCH ON DISABLED.

        Raises:
            AxisFault: an axis faults, or does not become enabled.
        """
        chosen = self.channels if channels is None else channels
        self._cycle.pump(0.0)
        self._cycle.clear_alarms()
        if self.change_over(mode, chosen):
            return
        self.switch_off()
        self.wait_for_rest(RINGING_TIMEOUT)
        self.set_mode(mode)
        self.go(State.OPERATION_ENABLED, chosen)

    def change_over(self, mode: Mode, channels: Sequence[Channel]) -> bool:
        """Changes the mode of operation under power, without a jump, where that is possible.

        Returns:
            False when an axis is not enabled or its drive refuses.

        Raises:
            AxisFault: an axis faults meanwhile.
        """
        ready = State.OPERATION_ENABLED
        if self.mode is None or not all(c.seen and state_of(c) is ready for c in channels):
            return False
        self.ramp_offsets_out()
        if self.mode is Mode.CYCLIC_SYNC_TORQUE:
            self.wait_for_rest(HOLDING_TIMEOUT)  # nothing has held the axes
        for channel in self.channels:
            channel.controlword &= ~_MODE_BITS
            if self.mode is Mode.HOMING:  # its targets were in other coordinates
                channel.target = channel.position
        self._aim(mode)
        self._cycle.resume()
        for _ in range(2):  # 0x607A is right in the drive before the mode that obeys it begins
            self._cycle.exchange()
        try:
            self.set_mode(mode)
        except NodeError as refused:
            if refused.abort_code is None:
                raise
            return False
        self.go(ready, channels)
        return True

    def wait_for_rest(self, timeout: float) -> None:
        """Waits until all axes stand still, or `timeout` [s] is over."""
        recent: deque[tuple[int, ...]] = deque(maxlen=REST_SYNCS)
        for _ in self._cycles(timeout, blind=True):
            recent.append(tuple(c.position for c in self.channels))
            if len(recent) == REST_SYNCS and not self._moved(recent):
                return

    def _moved(self, recent: Iterable[tuple[int, ...]]) -> list[Channel]:
        """Those that did not keep within the rest band over these positions [increments]."""
        return [
            c
            for p, c in zip(zip(*recent, strict=True), self.channels, strict=True)
            if max(p) - min(p) > REST_BAND / c.axis.scale.increment
        ]

    def go(self, target: State, channels: Sequence[Channel] | None = None) -> None:
        """Leads axes (all by default) to `target`; one that faults stops the attempt.

        Raises:
            AxisFault: an axis is in or falls into FAULT, or does not get there in the time that
                its settings give it.
        """
        chosen = self.channels if channels is None else channels
        self.loose.update(c.axis.name for c in chosen)
        late = chosen[0]
        longest = max(TIMEOUT, *(c.axis.settings.enable_timeout for c in chosen))
        for count, _ in enumerate(self._cycles(longest), 1):
            waiting = [c for c in chosen if not self._led(c, target)]
            if not waiting:
                return
            late = min(waiting, key=_patience)
            if count >= round(_patience(late) / self._period):
                break
        if not late.seen:
            self._silent(late)
        raise fault(late, f"does not reach {target} within {_patience(late):g} s (enable_timeout)")

    @staticmethod
    def _led(channel: Channel, target: State) -> bool:
        """One step further towards `target`; whether it is there."""
        if not channel.seen:
            return False
        state = state_of(channel)
        if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            raise fault(channel, IN_FAULT)
        channel.controlword = next_controlword(state, target, channel.controlword)
        if state is not State.OPERATION_ENABLED:
            channel.rest()
        return state is target

    def _silent(self, channel: Channel) -> None:
        raise AxisFault(
            f"no process data (TPDO 0x{channel.axis.tpdo_id:03X}) at all: does it answer SYNC?",
            axis=channel.axis.name, obj=od.STATUSWORD,
        )  # fmt: skip

    def reset_faults(self) -> None:
        """Acknowledges the faults of all axes that have one.

        Raises:
            AxisFault: a fault stays (its cause persists).
        """
        self._cycle.clear_alarms()
        for _ in self._cycles(TIMEOUT, blind=True):
            waiting = False
            for channel in self.channels:
                if not channel.seen:
                    waiting = True
                    continue
                state = state_of(channel)
                if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
                    waiting = True
                    channel.controlword = next_controlword(
                        state, State.SWITCH_ON_DISABLED, channel.controlword
                    )
                    channel.rest()
                elif channel.controlword & Command.FAULT_RESET:
                    channel.controlword = int(Command.DISABLE_VOLTAGE)
                    waiting = True
            if not waiting:
                self._cycle.clear_alarms()
                return
        for channel in self.channels:
            if not channel.seen:
                self._silent(channel)
            if state_of(channel) in (State.FAULT, State.FAULT_REACTION_ACTIVE):
                raise fault(channel, "the fault cannot be reset")

    def ramp_offsets_out(self) -> None:
        """Takes the force offsets back to 0 at constant targets, while enabled."""
        steps = max(1, round(OFFSET_RAMP / self._period))
        start = [c.offset for c in self.channels]
        if not any(start) or not self.enabled:
            return
        self._cycle.resume()
        for step in range(1, steps + 1):
            for channel, offset in zip(self.channels, start, strict=True):
                channel.offset = round(offset * (1 - step / steps))
            self._cycle.exchange()

    def quick_stop(self, timeout: float) -> None:
        """Quick-stops all axes at once and waits until none is moving under power.

        Setpoints or SYNC may not get through where SDO does, so that is tried as well. Axes that
        stay silent are given the time in which their drives notice that we do not reach them. One
        that is heard, and goes on, may hear our heartbeat and nothing else: it has to miss that,
        until the next boot or reset of faults.

        Raises:
            AxisFault: an axis is still enabled or still stopping after `timeout` [s].
            BusError: the bus fails.
        """
        moving = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
        for channel in self.channels:
            channel.controlword, channel.offset = int(Command.QUICK_STOP), 0
        last: tuple[int, ...] = ()
        given_up = round(GIVEN_UP / self._period)
        for count, _ in enumerate(self._cycles(max(timeout, GIVEN_UP), blind=True), 1):
            positions = tuple(c.position for c in self.channels)
            still, last = positions == last, positions
            states = [state_of(c) for c in self.channels if c.valid]
            # drives with option codes 5..8 stay in QUICK STOP ACTIVE: standing still is the end
            if not any(
                s in moving and (s is not State.QUICK_STOP_ACTIVE or not still) for s in states
            ):
                if len(states) == len(self.channels) or count >= given_up:
                    self._cycle.beat(True)
                    return
            if count == round(UNHEARD / self._period):
                self._cycle.beat(moving[0] not in states)
                self.attempt_by_sdo(
                    Command.QUICK_STOP,
                    [c for c in self.channels if not c.valid or state_of(c) is moving[0]],
                )
        for channel in self.channels:
            if channel.valid and state_of(channel) in moving:
                raise AxisFault(
                    f"0x{channel.statusword:04X}: still {state_of(channel)} {timeout:g} s after "
                    "the quick stop",
                    axis=channel.axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def halt(self, timeout: float) -> None:
        """Halts all enabled axes by controlword bit 8; they end at rest, holding where they are.

        Raises:
            AxisFault: an axis faults, or still moves after `timeout` [s].
            BusError: the bus fails.
        """
        self.stand_still(timeout)
        for channel in self.channels:
            channel.rest()
            channel.controlword &= ~int(Control.HALT)
        self._cycle.resume()
        self._cycle.exchange()

    def stand_still(self, timeout: float) -> None:
        """Brakes by controlword bit 8, which stays set; raises as `halt`."""
        recent: deque[tuple[int, ...]] = deque(maxlen=REST_SYNCS)
        for channel in self.channels:
            channel.controlword |= int(Control.HALT)
            channel.offset = 0
        for _ in self._cycles(timeout):
            recent.append(tuple(c.position for c in self.channels))
            for channel in self.channels:
                if channel.valid and state_of(channel) is not State.OPERATION_ENABLED:
                    raise fault(channel, "left OPERATION ENABLED on the way to a halt")
            still = len(recent) == REST_SYNCS and not self._moved(recent)
            # bit 10 says velocity 0 with halt; a drive without it is believed at rest
            if still and all(c.valid for c in self.channels):
                return
        moving = self._moved(recent) or self.channels
        raise fault(moving[0], f"still moves {timeout:g} s after halt")

    def switch_off(self) -> None:
        """Power off on all axes, whatever state they are in; stays silent about faults.

        Where the process data do not show it, SDO is tried; what is still not known to be without
        power stays in `loose`.

        Raises:
            BusError: the bus fails.
        """
        for channel in self.channels:
            channel.controlword, channel.offset = int(Command.DISABLE_VOLTAGE), 0
        off = (State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY_TO_SWITCH_ON)
        for _ in self._cycles(TIMEOUT, blind=True):
            if all(state_of(c) in off if c.valid else c.missed > 1 for c in self.channels):
                break
        doubtful = [c for c in self.channels if not (c.valid and state_of(c) in off)]
        self.attempt_by_sdo(Command.DISABLE_VOLTAGE, doubtful)
        for channel in self.channels:
            if channel not in doubtful or self._state_by_sdo(channel) in off:
                self.loose.discard(channel.axis.name)

    def attempt_by_sdo(self, command: Command, channels: Sequence[Channel] | None = None) -> None:
        """Writes a controlword by SDO where the cyclic path is no way; errors are passed over.

        Args:
            command: to be written.
            channels: of these axes, all by default.
        """
        chosen = self.channels if channels is None else channels
        for channel in chosen:
            node = channel.axis.node
            try:
                # who is silent may still listen, but is not waited for again
                (node.tell if node.silent else node.write)(od.CONTROLWORD, int(command))
            except DriverError:
                continue
        if chosen:
            self._cycle.resume()

    def _state_by_sdo(self, channel: Channel) -> State | None:
        """The power state that the drive tells when asked, None where it does not answer."""
        if channel.axis.node.silent:
            return None
        try:
            return decode(channel.axis.node.read(od.STATUSWORD))
        except DriverError:
            return None
        finally:
            self._cycle.resume()

    def _cycles(self, timeout: float, blind: bool = False) -> Cycles:
        return Cycles(self._cycle, timeout, self._period, blind)


class Cycles:
    """Iterates over SYNCs with the channels' commands until a timeout [s] has gone by.

    The first value comes after the first SYNC. The last cycle's commands are sent before the
    next value, so that a loop sets commands for the SYNC to come.
    """

    def __init__(self, cycle: Cycle, timeout: float, period: float, blind: bool) -> None:
        self._exchange: Callable[[], None] = cycle.exchange_blindly if blind else cycle.exchange
        self._left = max(1, round(timeout / period))
        cycle.resume()

    def __iter__(self) -> Cycles:
        return self

    def __next__(self) -> None:
        if self._left == 0:
            raise StopIteration
        self._left -= 1
        self._exchange()
