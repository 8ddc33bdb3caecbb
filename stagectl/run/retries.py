"""After a fault: whether the stage may go on by itself, and how it is made ready again."""

from __future__ import annotations

from collections.abc import Callable

from drivers import AxisFault, BusError, DriverError, Stage
from stagectl.errors import RunFault

LASTING = (0x2, 0x3, 0x4, 0x5, 0x7)
"""Classes of error codes (their first digit) after which somebody has to look before power comes
back: current, voltage, temperature, hardware, sensors."""
OVER_TRAVEL = 0x8612


def recover(
    stage: Stage,
    fault: AxisFault,
    attempt: int,
    most: int,
    trying: Callable[[int, str], object],
) -> int:
    """From a stopped stage with a fault to an enabled one.

    A fault on the way, such as one that the other axis had meanwhile, is one attempt more.

    Args:
        stage: to be made ready again.
        fault: what it was stopped by.
        attempt: the number of this attempt at the present site, from 1.
        most: attempts at one site.
        trying: called with an attempt's number and the fault that it is after.

    Returns:
        The number of the attempt that succeeded.

    Raises:
        AxisFault: the fault itself, where it may not be acknowledged, or not once more.
        RunFault: the same of a fault on the way.
        BusError: the bus fails.
    """
    last = fault
    while attempt <= most and recoverable(last):
        trying(attempt, str(last))
        try:
            _make_ready(stage)
            return attempt
        except BusError:
            raise
        except AxisFault as another:
            last, attempt = another, attempt + 1
        except DriverError as stays:
            raise RunFault(f"{fault}; trying to go on: {stays}") from stays
    if last is fault:
        raise fault
    raise RunFault(f"{fault}; trying to go on: {last}") from last


def _make_ready(stage: Stage) -> None:
    try:
        stage.reset_faults()
    except BusError:
        raise
    except DriverError:  # a drive that rebooted, or that takes no reset as it is
        stage.boot()
    stage.home()  # only axes that have lost their zero
    stage.enable()


def recoverable(fault: AxisFault) -> bool:
    """Whether a fault may be acknowledged and gone on from without anybody looking at the machine.

    Lost frames, a drive that lost its host or rebooted, a following error: yes, as often as the
    run allows. Current, voltage, temperature, hardware, sensors and end switches: no.
    """
    code = fault.code
    return code is None or (code >> 12 not in LASTING and code != OVER_TRAVEL)
