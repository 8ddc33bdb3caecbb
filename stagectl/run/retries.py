"""After a fault: whether the run may continue by itself, and how the stage is made ready again."""

from __future__ import annotations

from collections.abc import Callable

from drivers import AxisFault, BusError, DriverError, Stage
from stagectl.errors import RunFault

LASTING = (0x2, 0x3, 0x4, 0x5, 0x7)
"""Classes of error codes (first digit) that need an inspection before power returns: current,
voltage, temperature, hardware, sensors."""
OVER_TRAVEL = 0x8612


def recover_stage(
    stage: Stage,
    fault: AxisFault,
    attempt: int,
    limit: int,
    announce: Callable[[int, str], object],
) -> int:
    """Acknowledge a fault, home where necessary, and enable the stage again.

    Another fault meanwhile, such as one pending on the other axis, counts as one more attempt.

    Args:
        stage: stopped by the fault.
        fault: that stopped it.
        attempt: number of this attempt at the present site, from 1.
        limit: attempts allowed per site.
        announce: called with the number of each attempt and the fault before it.

    Returns:
        The number of the attempt that succeeded.

    Raises:
        AxisFault: the fault itself, where it must not be acknowledged or the limit is reached.
        RunFault: the same for a fault during recovery.
        BusError: the bus failed.
    """
    latest = fault
    while attempt <= limit and is_recoverable(latest):
        announce(attempt, str(latest))
        try:
            acknowledge_faults(stage)
            stage.home()  # only axes that have lost their reference
            stage.enable()
            return attempt
        except BusError:
            raise
        except AxisFault as another:
            latest, attempt = another, attempt + 1
        except DriverError as error:
            raise RunFault(f"{fault}; recovery failed: {error}") from error
    if latest is fault:
        raise fault
    raise RunFault(f"{fault}; recovery failed: {latest}") from latest


def acknowledge_faults(stage: Stage, announce: Callable[[str], object] = lambda _: None) -> None:
    """Acknowledge faults, and boot drives that have restarted since.

    Args:
        stage: booted once.
        announce: called with what is being done.

    Raises:
        DriverError: the drives cannot be reached.
    """
    announce("acknowledging faults")
    try:
        stage.reset_faults()
    except BusError:
        raise
    except DriverError:  # the drive has rebooted, or takes no fault reset in its state
        announce("booting the drives")
        stage.boot()


def is_recoverable(fault: AxisFault) -> bool:
    """Whether a fault may be acknowledged without anybody looking at the machine.

    Yes: lost frames, a drive that lost its host or rebooted, a following error. No: current,
    voltage, temperature, hardware, sensors and limit switches.
    """
    code = fault.code
    return code is None or (code >> 12 not in LASTING and code != OVER_TRAVEL)
