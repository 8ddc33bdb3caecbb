"""Errors of the driver. Each names axis, object and cause on one line.

    DriverError
    |- BusError              the bus cannot be sent to or received from
    |  `- BusOpenError       it cannot be opened
    |- NodeError             a node does not answer, refuses an access, or is another device
    |- ConfigurationError    a setting is impossible, or a drive did not accept it
    |- LimitError            a request exceeds the axis' limits; nothing was sent
    `- AxisFault             an axis left OPERATION ENABLED or fell silent
       `- HomingError        homing failed, was interrupted or took too long

For instance `axis x: 0x6065:00 following error window: cause`.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.objects import ObjectRef


def shown(value: object) -> str:
    """A value for messages: bytes in hexadecimal, strings in quotes, no type names."""
    match value:
        case bytes() | bytearray():
            return value.hex(" ").upper() or "nothing"
        case bool() | None:
            return str(value).lower()
        case int():
            return str(int(value))  # also of an enumeration
        case float():
            return f"{float(value):.12g}"
        case str():
            return f'"{value}"'
        case tuple() | list():
            return ", ".join(map(shown, value)) or "nothing"
    return str(value)


@dataclass(frozen=True, slots=True)
class FaultReport:
    """All that is known about a fault: first what the host knew, then what the drive says.

    Attributes:
        statusword: the last one, None before the first.
        emergencies: EMCY codes since alarms were last cleared, oldest first.
        controlwords: the last ones, without repetitions, oldest first.
        mode: mode of operation, None before the first.
        target: last setpoint as text, with its unit.  offset: last force offset [N].
        boots: number of boot-up messages of its drive.
        error_code: 0x603F, error_register: 0x1001; None where the drive lacks them.
        history: latest codes of 0x1003, newest first.
    """

    statusword: int | None
    emergencies: tuple[int, ...]
    controlwords: tuple[int, ...]
    mode: int | None
    target: str
    offset: float
    boots: int
    error_code: int | None = None
    error_register: int | None = None
    history: tuple[int, ...] = ()

    @property
    def code(self) -> int | None:
        """The code of the cause: first emergency, else 0x603F, else the newest of the history."""
        first = next((e for e in self.emergencies if e & 0xFF00), None)
        return first or self.error_code or next(iter(self.history), None)


class DriverError(Exception):
    """A failure of bus, node or axis.

    Attributes:
        cause: what happened, one clause.
        axis: name of the axis, None for the bus.
        object: the CANopen object concerned, if any.
        abort_code: SDO abort code of a `NodeError`, None where there was no abort.
        code: error code (EMCY or 0x603F) of an `AxisFault`, None where the drive reports none.
        report: all that is known about an `AxisFault`, None until the axes have been stopped.
    """

    def __init__(
        self,
        cause: str,
        *,
        axis: str | None = None,
        obj: ObjectRef | None = None,
        abort_code: int | None = None,
        code: int | None = None,
        report: FaultReport | None = None,
    ) -> None:
        self.cause, self.axis, self.object = cause, axis, obj
        self.abort_code, self.code, self.report = abort_code, code, report
        where = [] if axis is None else [f"axis {axis}"]
        if obj is not None:
            where.append(str(obj))
        super().__init__(": ".join([*where, cause]))


class BusError(DriverError):
    """The CAN bus cannot be opened, written to or read from."""


class BusOpenError(BusError):
    """The CAN bus cannot be opened: unknown interface, missing driver, no such channel."""


class NodeError(DriverError):
    """A node does not answer, refuses an access, or is not the device its EDS describes."""


class RefusedError(NodeError):
    """The drive answered an SDO access with an abort: it refuses this, and is there.

    Raised with an `abort_code`.
    """


class ConfigurationError(DriverError):
    """A setting is impossible, or a drive holds a value other than the one written."""


class LimitError(DriverError):
    """A setpoint is outside the axis' limits; raised before anything is sent."""


class AxisFault(DriverError):  # noqa: N818
    """An axis faulted, left OPERATION ENABLED, or sends no process data or heartbeat."""


class HomingError(AxisFault):
    """Homing ended in an error, was interrupted, did not start or took too long."""
