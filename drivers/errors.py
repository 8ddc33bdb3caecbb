"""What can go wrong between host and drives: every error names axis, object and cause.

    DriverError
    |- BusError              the bus itself: cannot open, send or receive
    |- NodeError             a node does not answer, refuses an access, or is another device
    |- ConfigurationError    the drive cannot be, or was not, configured as asked
    |- LimitError            asked for more than the axis may do; nothing was sent
    |- AxisFault             an axis left its operating state or fell silent
    `- HomingError           homing failed, was interrupted or took too long

The text is one line, `axis x: 0x6065:00 following error window: cause`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.objects import ObjectRef

if TYPE_CHECKING:
    from drivers.motion.fault_report import FaultReport


def shown(value: object) -> str:
    """A value as people write it: bytes in hexadecimal, texts in quotes, no name of a type."""
    match value:
        case bytes() | bytearray():
            return value.hex(" ").upper() or "nothing"
        case bool() | None:
            return str(value).lower()
        case int():
            return str(int(value))  # of an enumeration, too
        case float():
            return repr(float(value))
        case str():
            return f'"{value}"'
        case tuple() | list():
            return ", ".join(map(shown, value)) or "nothing"
    return str(value)


class DriverError(Exception):
    """A failure of bus, node or axis.

    Attributes:
        cause: what happened, one clause.
        axis: name of the axis, None where it concerns the bus.
        object: the CANopen object concerned, None where there is none.
    """

    def __init__(
        self, cause: str, *, axis: str | None = None, obj: ObjectRef | None = None
    ) -> None:
        self.cause = cause
        self.axis = axis
        self.object = obj
        where = [] if axis is None else [f"axis {axis}"]
        if obj is not None:
            where.append(str(obj))
        super().__init__(": ".join([*where, cause]))


class BusError(DriverError):
    """The CAN bus cannot be opened, written to or read from."""


class NodeError(DriverError):
    """A node does not answer, refuses an access, or is not the device its EDS describes.

    Attributes:
        abort_code: SDO abort code, None where the node did not answer at all.
    """

    def __init__(
        self,
        cause: str,
        *,
        axis: str | None = None,
        obj: ObjectRef | None = None,
        abort_code: int | None = None,
    ) -> None:
        super().__init__(cause, axis=axis, obj=obj)
        self.abort_code = abort_code


class ConfigurationError(DriverError):
    """A setting is impossible, or the drive holds another value than the one written."""


class LimitError(DriverError):
    """A setpoint is outside what the axis may do; raised before anything is sent."""


class AxisFault(DriverError):  # noqa: N818
    """An axis faulted, left OPERATION ENABLED, or its process data or heartbeat stayed away.

    Attributes:
        code: error code (EMCY or 0x603F), None where the drive told none.
        report: all that is known (`diagnosis.FaultReport`), None where nobody looked yet.
    """

    def __init__(
        self,
        cause: str,
        *,
        axis: str | None = None,
        obj: ObjectRef | None = None,
        code: int | None = None,
        report: FaultReport | None = None,
    ) -> None:
        super().__init__(cause, axis=axis, obj=obj)
        self.code = code
        self.report = report


class HomingError(AxisFault):
    """Homing ended in an error, was interrupted, did not start or took too long."""
