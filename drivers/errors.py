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

from dataclasses import dataclass

from drivers.objects import ObjectRef


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
            return f"{float(value):.12g}"
        case str():
            return f'"{value}"'
        case tuple() | list():
            return ", ".join(map(shown, value)) or "nothing"
    return str(value)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the host knows of an axis at the moment of a fault.

    Attributes:
        statusword: last one, None before the first.
        emergencies: codes since alarms were last cleared, oldest first.
        controlwords: last ones, each once, oldest first.
        mode: of operation, None before the first.
        target: last set-point in words, with its unit.  offset: last force offset [N].
        boots: boot-up messages of its drive so far.
    """

    statusword: int | None
    emergencies: tuple[int, ...]
    controlwords: tuple[int, ...]
    mode: int | None
    target: str
    offset: float
    boots: int


@dataclass(frozen=True, slots=True)
class FaultReport:
    """All that is known of a fault.

    Attributes:
        evidence: taken when it was noticed.
        error_code: 0x603F.  error_register: 0x1001.  None where the drive does not have them.
        history: newest codes of 0x1003, newest first.
    """

    evidence: Evidence
    error_code: int | None
    error_register: int | None
    history: tuple[int, ...]

    @property
    def code(self) -> int | None:
        """The code that names the cause: the first emergency, else 0x603F, else the history's."""
        first = next((e for e in self.evidence.emergencies if e & 0xFF00), None)
        return first or self.error_code or next(iter(self.history), None)


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
        report: all that is known of it, None before anybody looked.
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
