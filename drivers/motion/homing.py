"""Homing (mode hm) of all axes together, judged by the statusword of every SYNC.

Statusword bits 13 (error), 12 (attained), 10 (target reached): 0 0 0 in progress; 0 0 1 not
started or interrupted; 0 1 0 attained, still moving; 0 1 1 done; 1 x x error. "Not started" and
"interrupted" look alike: what tells them apart is whether it was in progress before.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto

from drivers import objects as od
from drivers.canopen import error_text
from drivers.cyclic import Channel, Cycle
from drivers.drive import Command, Control, Mode, State, Status
from drivers.errors import HomingError
from drivers.motion.power import HOLDING_TIMEOUT, Cycles, Power, state_of
from drivers.motion.safe_stop import SafeStop
from drivers.settings import AxisSettings

START_TIMEOUT = 0.5
"""How long a drive may take to begin [s]."""
STANDSTILL = 2.0
"""An axis whose position has been the very same for so long while it homes does not move [s]."""
STILL_BAND = 10e-6
HOME_BAND = 100e-6
"""So far the drive's own word may be from its process data, which are a little older [m]."""
SETTLE = 0.05
"""An old "attained" may stand this long after the start before it is believed [s]."""


class Progress(Enum):
    """What an axis' homing is doing."""

    WAITING = auto()
    RUNNING = auto()
    DONE = auto()
    INTERRUPTED = auto()
    FAILED = auto()


def timeout_for(settings: AxisSettings) -> float:
    """Longest sensible homing [s]: the whole travel there and back at the slower speed."""
    low, high = settings.travel
    return 2 * (high - low) / min(settings.homing_velocity) + START_TIMEOUT


def judge(statusword: int, before: Progress, elapsed: float) -> Progress:
    """The progress after one more statusword.

    Args:
        statusword: in mode hm, start bit set.
        before: progress until now.
        elapsed: since the start bit was sent [s].
    """
    if statusword & Status.HOMING_ERROR:
        return Progress.FAILED
    reached = bool(statusword & Status.TARGET_REACHED)
    if statusword & Status.HOMING_ATTAINED:
        believed = before is Progress.RUNNING or elapsed >= SETTLE
        return Progress.DONE if reached and believed else before
    if not reached:
        return Progress.RUNNING
    return Progress.INTERRUPTED if before is Progress.RUNNING else Progress.WAITING


class Homing:
    """Homing of the stage's axes; arguments and errors are those of `Stage`."""

    mode = Mode.HOMING

    def __init__(self, cycle: Cycle, power: Power, stopping: SafeStop) -> None:
        self._cycle, self._power, self._stopping = cycle, power, stopping

    def home(self, force: bool) -> None:
        """All axes that are not homed yet, or with `force` all."""
        chosen = [c for c in self._cycle.channels if force or not c.axis.homed]
        if not chosen:
            return
        with self._stopping.on_failure():
            self._power.enter(self.mode, chosen)
            home(self._cycle, chosen, self._cycle.period)
            # the drive is done when its demand is; the following error that is left would become a
            # step of the target when csp takes over from the actual position
            self._power.wait_for_rest(HOLDING_TIMEOUT)
            self._cycle.check_alarms()


def home(cycle: Cycle, channels: Sequence[Channel], period: float) -> None:
    """Homes the channels, which are enabled in mode hm; they end at rest, start bit cleared.

    Process data that do not change any more would show an old homing, or one that never ends: what
    they say at the end is asked for once more by SDO.

    Raises:
        HomingError: an axis reports an error, stops on the way, does not begin, stands still, or is
            not done within its timeout; or its process data are not what the drive says by SDO.
        AxisFault: an alarm or missing process data.
    """
    progress = dict.fromkeys(channels, Progress.WAITING)
    limits = {c: timeout_for(c.axis.settings) for c in channels}
    stands = {c: (c.position, 0.0) for c in channels}
    for channel in channels:
        channel.controlword = int(Command.ENABLE_OPERATION | Control.START_HOMING)
    for count, _ in enumerate(Cycles(cycle, max(limits.values()) + 1, period, blind=False)):
        elapsed = count * period
        for channel in channels:
            if progress[channel] is Progress.DONE or not channel.valid:
                continue
            if state_of(channel) is not State.OPERATION_ENABLED:
                raise _error(channel, f"left OPERATION ENABLED, is in {state_of(channel)}")
            now = progress[channel] = judge(channel.statusword, progress[channel], elapsed)
            if now is Progress.DONE:
                channel.controlword = int(Command.ENABLE_OPERATION)
            elif now is Progress.FAILED:
                raise _error(channel, "the drive reports a homing error")
            elif now is Progress.INTERRUPTED:
                raise _error(channel, "homing was interrupted before it was attained")
            elif now is Progress.WAITING and elapsed > START_TIMEOUT:
                raise _error(channel, f"homing did not begin within {START_TIMEOUT:g} s")
            elif elapsed > limits[channel]:
                raise _error(channel, f"homing not done within {limits[channel]:g} s")
            if channel.position != stands[channel][0]:
                stands[channel] = (channel.position, elapsed)
            elif now is not Progress.DONE and elapsed - stands[channel][1] > STANDSTILL:
                raise _error(channel, _why_still(channel))
        if all(p is Progress.DONE for p in progress.values()):
            for channel in channels:
                _check_by_sdo(channel)
            cycle.resume()
            cycle.exchange()  # start bits off
            for channel in channels:
                channel.axis.homed = True
            return


def _why_still(channel: Channel) -> str:
    """Whether the axis stands still, or what is heard of it does."""
    node = channel.axis.node
    position = node.read(od.POSITION_ACTUAL)
    if abs(position - channel.position) * channel.axis.scale.increment > STILL_BAND:
        return (
            f"its process data (TPDO 0x{channel.axis.tpdo_id:03X}) have stood still for "
            f"{STANDSTILL:g} s, and by SDO it is elsewhere: the TPDO is frozen"
        )
    return f"the axis has not moved at all for {STANDSTILL:g} s"


def _check_by_sdo(channel: Channel) -> None:
    """What the process data said of the end of homing, once more.

    Raises:
        HomingError: the drive says something else.
    """
    node = channel.axis.node
    word, position = node.read(od.STATUSWORD), node.read(od.POSITION_ACTUAL)
    apart = abs(position - channel.position) * channel.axis.scale.increment
    if not word & Status.HOMING_ATTAINED or apart > HOME_BAND:
        raise _error(
            channel,
            f"done by its process data (TPDO 0x{channel.axis.tpdo_id:03X}), but by SDO it is "
            f"{apart:.3g} m elsewhere, statusword 0x{word:04X}: the TPDO is frozen",
        )


def _error(channel: Channel, what: str) -> HomingError:
    """Homing error with method, statusword, and the error code where the drive has one."""
    axis = channel.axis
    code = axis.error_code()
    cause = (
        f"method {axis.settings.homing_method}: {what} (statusword 0x{channel.statusword:04X}"
        + (f", {error_text(code)})" if code else ")")
    )
    return HomingError(cause, axis=axis.name, obj=od.HOMING_METHOD, code=code or None)
