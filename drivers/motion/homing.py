"""Homing (mode hm) of all axes together, followed by the statusword of every SYNC.

Statusword bits 13 (error), 12 (attained), 10 (target reached): 0 0 0 in progress; 0 0 1 not
started or interrupted; 0 1 0 attained, still moving; 0 1 1 done; 1 x x error. "Not started" and
"interrupted" differ only in whether homing was in progress before.

Source: CiA 402-2, mode 6: 0x6098, 0x6099, 0x609A, 0x607C.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto

from drivers import objects as od
from drivers.canopen import error_text
from drivers.cyclic import Channel, Cycle
from drivers.drive import Command, Control, State, Status
from drivers.errors import HomingError
from drivers.motion.fault_report import read_quietly
from drivers.settings import AxisSettings

START_TIMEOUT = 0.5
"""How long a drive may take to start homing [s]."""
STANDSTILL = 2.0
"""An axis that homes and reports the identical position for so long does not move [s]."""
STILL_BAND = 10e-6
HOME_BAND = 100e-6
"""Allowed difference between position by SDO and by process data, which are a little older [m]."""
SETTLE = 0.05
""""Attained" may be left from an earlier homing for so long after the start [s]."""


class Progress(Enum):
    """Progress of one axis' homing."""

    WAITING = auto()
    RUNNING = auto()
    DONE = auto()
    INTERRUPTED = auto()
    FAILED = auto()


def homing_timeout(settings: AxisSettings) -> float:
    """Longest plausible homing [s]: the whole travel and back at the slower velocity."""
    low, high = settings.travel
    return 2 * (high - low) / min(settings.homing_velocity) + START_TIMEOUT


def next_progress(statusword: int, before: Progress, elapsed: float) -> Progress:
    """The progress that a statusword shows.

    Args:
        statusword: in mode hm, start bit set.
        before: the progress so far.
        elapsed: since the start bit was sent [s].
    """
    if statusword & Status.HOMING_ERROR:
        return Progress.FAILED
    reached = bool(statusword & Status.TARGET_REACHED)
    if statusword & Status.HOMING_ATTAINED:
        is_current = before is Progress.RUNNING or elapsed >= SETTLE
        return Progress.DONE if reached and is_current else before
    if not reached:
        return Progress.RUNNING
    return Progress.INTERRUPTED if before is Progress.RUNNING else Progress.WAITING


def home(cycle: Cycle, channels: Sequence[Channel]) -> None:
    """Homes axes that are enabled in mode hm; they end at rest with the start bit cleared.

    Frozen process data could show an earlier homing or one that never ends, so the end is confirmed
    by SDO.

    Raises:
        HomingError: an axis reports an error, is interrupted, does not start, does not move, or is
            not done in time; or its process data contradict SDO.
        AxisFault: an alarm or missing process data.
    """
    progress = dict.fromkeys(channels, Progress.WAITING)
    limits = {c: homing_timeout(c.axis.settings) for c in channels}
    last_moved = {c: (c.position, 0.0) for c in channels}
    for channel in channels:
        channel.controlword = int(Command.ENABLE_OPERATION | Control.START_HOMING)
    for count, _ in enumerate(cycle.cycles(max(limits.values()) + 1)):
        elapsed = count * cycle.period
        for channel in channels:
            if progress[channel] is Progress.DONE or not channel.valid:
                continue
            if channel.state is not State.OPERATION_ENABLED:
                raise _error(channel, f"left OPERATION ENABLED, is in {channel.state}")
            now = next_progress(channel.statusword, progress[channel], elapsed)
            progress[channel] = now
            if now is Progress.DONE:
                channel.controlword = int(Command.ENABLE_OPERATION)
            elif now is Progress.FAILED:
                raise _error(channel, "the drive reports a homing error")
            elif now is Progress.INTERRUPTED:
                raise _error(channel, "homing was interrupted")
            elif now is Progress.WAITING and elapsed > START_TIMEOUT:
                raise _error(channel, f"homing did not start within {START_TIMEOUT:g} s")
            elif elapsed > limits[channel]:
                raise _error(channel, f"homing not done within {limits[channel]:g} s")
            if channel.position != last_moved[channel][0]:
                last_moved[channel] = (channel.position, elapsed)
            elif now is not Progress.DONE and elapsed - last_moved[channel][1] > STANDSTILL:
                raise _error(channel, _why_still(channel))
        if all(p is Progress.DONE for p in progress.values()):
            for channel in channels:
                _check_by_sdo(channel)
            cycle.sync.resume()
            cycle.exchange()  # start bits off
            for channel in channels:
                channel.axis.homed = True
            return


def _why_still(channel: Channel) -> str:
    """A clause on whether the axis stands still, or its process data are frozen."""
    node = channel.axis.node
    position = node.read(od.POSITION_ACTUAL)
    if abs(position - channel.position) * channel.axis.increment > STILL_BAND:
        return (
            f"its process data (TPDO 0x{channel.axis.tpdo_id:03X}) have not changed for "
            f"{STANDSTILL:g} s, and SDO shows another position: the TPDO is frozen"
        )
    return f"the axis has not moved for {STANDSTILL:g} s"


def _check_by_sdo(channel: Channel) -> None:
    """Confirms the end of homing.

    Raises:
        HomingError: SDO contradicts the process data.
    """
    node = channel.axis.node
    word, position = node.read(od.STATUSWORD), node.read(od.POSITION_ACTUAL)
    apart = abs(position - channel.position) * channel.axis.increment
    if not word & Status.HOMING_ATTAINED or apart > HOME_BAND:
        raise _error(
            channel,
            f"done by its process data (TPDO 0x{channel.axis.tpdo_id:03X}), but by SDO it is "
            f"{apart:.3g} m away with statusword 0x{word:04X}: the TPDO is frozen",
        )


def _error(channel: Channel, what: str) -> HomingError:
    """A homing error with method, statusword and, where the drive reports one, error code."""
    axis = channel.axis
    code = read_quietly(axis.node, od.ERROR_CODE)
    cause = (
        f"method {axis.settings.homing_method}: {what} (statusword 0x{channel.statusword:04X}"
        + (f", {error_text(code)})" if code else ")")
    )
    return HomingError(cause, axis=axis.name, obj=od.HOMING_METHOD, code=code or None)
