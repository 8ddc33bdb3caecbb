"""Access to the objects of one node by SDO, as its EDS describes them.

Adds to canopen's dictionary errors that name axis and object, one retry of a lost SDO, and
read-back. An object that holds its value already is not written.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import canopen

from drivers import objects as od
from drivers.canopen.bus import Network
from drivers.canopen.sdo_channel import SdoChannel
from drivers.errors import ConfigurationError, NodeError, RefusedError, shown
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

T = TypeVar("T")
Value = int | float | str | bytes | bytearray
"""Value of an object, by its data type."""

SDO_ATTEMPTS = 2
HISTORY_LENGTH = 4
"""Entries read from 0x1003."""
_NOT_OFFERED = (0x06020000, 0x06090011)


def load_dictionary(settings: AxisSettings) -> canopen.ObjectDictionary:
    """The object dictionary in the axis' EDS.

    Raises:
        ConfigurationError: the file is missing or cannot be read as an EDS.
    """
    if not settings.eds.is_file():
        raise ConfigurationError(f"EDS file {settings.eds}: no such file", axis=settings.name)
    try:
        dictionary = canopen.import_od(str(settings.eds), settings.node)
    except Exception as why:  # the parser raises what int() and configparser raise
        reason = " ".join(str(why).split()) or type(why).__name__
        raise ConfigurationError(f"EDS file {settings.eds}: {reason}", axis=settings.name) from why
    if 0x1018 not in dictionary:
        raise ConfigurationError(
            f"EDS file {settings.eds}: has no identity object 0x1018", axis=settings.name
        )
    return dictionary


class RemoteObjects:
    """The objects of a node.

    Attributes:
        name: of its axis.  id: node id.  dictionary: of its EDS.
        silent: whether it left an SDO unanswered and nothing was received from it since.
    """

    def __init__(self, network: Network, settings: AxisSettings) -> None:
        self.name = settings.name
        self.id = settings.node
        self.silent = False
        self.dictionary = load_dictionary(settings)
        self._sdo = SdoChannel(network, settings.node)

    def offers(self, obj: ObjectRef) -> bool:
        """Whether the EDS lists the object."""
        return self._variable(obj) is not None

    def has(self, obj: ObjectRef) -> bool:
        """Whether the EDS lists the object and the node has it.

        Raises:
            NodeError: no answer.
        """
        if not self.offers(obj):
            return False
        try:
            self.read(obj)
        except RefusedError as refused:
            if refused.abort_code not in _NOT_OFFERED:
                raise
            return False
        return True

    def data_type(self, obj: ObjectRef) -> int:
        """CiA 301 data type number of the object, from the EDS.

        Raises:
            ConfigurationError: the EDS does not list it.
        """
        variable = self._variable(obj)
        if variable is None or variable.data_type is None:
            raise ConfigurationError("the EDS does not list it", axis=self.name, obj=obj)
        return int(variable.data_type)

    def limits(self, obj: ObjectRef) -> tuple[int | None, int | None]:
        """Lowest and highest value of an object by the EDS; None where it does not say."""
        variable = self._variable(obj)
        return (None, None) if variable is None else (variable.min, variable.max)

    def read(self, obj: ObjectRef) -> int:
        """Reads an integer object by SDO.

        Raises:
            NodeError: no answer, or the node aborts the access.
        """
        data = self._attempt("read", obj, lambda: self._sdo.upload(obj.index, obj.sub))
        variable = self._variable(obj)
        if variable is not None and len(data) * 8 > len(variable) >= 8:
            data = data[: len(variable) // 8]  # some drives send four bytes for every number
        if variable is None or len(data) * 8 != len(variable):
            return int.from_bytes(data, "little")
        return int(variable.decode_raw(data))

    def read_if_offered(self, obj: ObjectRef) -> int | None:
        """As `read`, for an optional object; None where the EDS lacks it or the node refuses.

        Raises:
            NodeError: no answer.
        """
        try:
            return self.read(obj) if self.offers(obj) else None
        except RefusedError:
            return None

    def error_history(self) -> tuple[int, ...]:
        """The newest error codes of 0x1003, newest first; empty where the node keeps none.

        Raises:
            NodeError: no answer.
        """
        codes = []
        with suppress(RefusedError):
            count = self.read(od.ERROR_COUNT) if self.offers(od.ERROR_COUNT) else 0
            for sub in range(1, min(count, HISTORY_LENGTH) + 1):
                codes.append(self.read(ObjectRef(0x1003, sub, "error history")) & 0xFFFF)
        return tuple(codes)

    def read_value(self, obj: ObjectRef) -> Value:
        """Reads an object of any type by SDO; bytes where the EDS does not list it.

        Raises:
            NodeError: as `read`, or the answer does not fit the object's type.
        """
        data = self._attempt("read", obj, lambda: self._sdo.upload(obj.index, obj.sub))
        variable = self._variable(obj)
        try:
            return data if variable is None else variable.decode_raw(data)
        except canopen.ObjectDictionaryError as why:
            raise NodeError(
                f"read: {len(data)} bytes do not fit its type", axis=self.name, obj=obj
            ) from why

    def write(self, obj: ObjectRef, value: Value) -> None:
        """Writes an object by SDO.

        Raises:
            ConfigurationError: the EDS does not list the object, or the value does not fit it.
            NodeError: no answer, or the node aborts the access.
        """
        data = self._encoded(obj, value)
        self._attempt(
            f"write of {shown(value)}",
            obj,
            lambda: self._sdo.download(obj.index, obj.sub, data),
        )

    def write_unanswered(self, obj: ObjectRef, value: int) -> None:
        """Writes without waiting for the answer: for stopping a node that may still listen.

        Raises:
            ConfigurationError: as `write`.
            BusError: the bus refuses it.
        """
        self._sdo.write_unanswered(obj.index, obj.sub, self._encoded(obj, value))

    def write_checked(self, obj: ObjectRef, value: int) -> None:
        """Writes an object and reads it back.

        Raises:
            ConfigurationError: the drive holds another value afterwards.
            NodeError: as `read` and `write`.
        """
        self._require(obj, value, self._write_and_read(obj, value))

    def write_optional(self, obj: ObjectRef, value: int) -> bool:
        """As `write_checked`, for an optional object.

        Returns:
            False where EDS or node do not offer it.

        Raises:
            ConfigurationError, NodeError: as `write_checked`, where it is offered.
        """
        result = self.write_if_accepted(obj, value)
        if result is not None:
            self._require(obj, value, result)
        return result is not None

    def write_if_accepted(
        self, obj: ObjectRef, value: int
    ) -> tuple[int, RefusedError | None] | None:
        """Writes an optional object; the caller judges the value that it holds then.

        Returns:
            The value held, and the refusal of the write if there was one; None where EDS or node do
            not offer the object.

        Raises:
            ConfigurationError: the value does not fit the object.
            NodeError: no answer, or it cannot be read.
        """
        if not self.offers(obj):
            return None
        try:
            return self._write_and_read(obj, value)
        except RefusedError as refused:
            if refused.abort_code in _NOT_OFFERED:
                return None
            raise

    def _write_and_read(self, obj: ObjectRef, value: int) -> tuple[int, RefusedError | None]:
        held = self.read(obj)
        if held == value:
            return held, None
        try:
            self.write(obj, value)
        except RefusedError as refused:
            if refused.abort_code in _NOT_OFFERED:
                raise
            return held, refused
        return self.read(obj), None

    def _require(self, obj: ObjectRef, value: int, result: tuple[int, RefusedError | None]) -> None:
        held, refusal = result
        if held != value:
            raise self.mismatch(obj, value, held, refusal)

    def mismatch(
        self, obj: ObjectRef, value: int, held: int, refusal: RefusedError | None
    ) -> ConfigurationError | RefusedError:
        """The error of a drive that holds another value than the one written."""
        if refusal is None:
            return ConfigurationError(
                f"wrote {value}, the drive holds {held}", axis=self.name, obj=obj
            )
        return RefusedError(
            f"{refusal.cause}; the drive holds {held}", axis=self.name, obj=obj,
            abort_code=refusal.abort_code,
        )  # fmt: skip

    def _variable(self, obj: ObjectRef) -> canopen.objectdictionary.ODVariable | None:
        return self.dictionary.get_variable(obj.index, obj.sub)

    def _encoded(self, obj: ObjectRef, value: Value) -> bytes:
        variable = self._variable(obj)
        if variable is None:
            raise ConfigurationError("the EDS does not list it", axis=self.name, obj=obj)
        try:
            return bytes(variable.encode_raw(value))
        except (struct.error, ValueError, OverflowError, TypeError) as why:
            raise ConfigurationError(
                f"{shown(value)} does not fit the object: {why}", axis=self.name, obj=obj
            ) from why

    def _attempt(self, what: str, obj: ObjectRef, access: Callable[[], T]) -> T:
        for left in reversed(range(SDO_ATTEMPTS)):
            try:
                result = access()
                self.silent = False
                return result
            except canopen.SdoAbortedError as abort:
                self.silent = False
                text = abort.CODES.get(abort.code, "no such abort code in CiA 301")
                raise RefusedError(
                    f"{what} refused: {text} (abort 0x{abort.code:08X})",
                    axis=self.name, obj=obj, abort_code=abort.code,
                ) from abort  # fmt: skip
            except canopen.SdoCommunicationError as silence:
                if not left:
                    self.silent = True
                    raise NodeError(
                        f"{what}: node {self.id} does not answer ({silence})",
                        axis=self.name, obj=obj,
                    ) from silence  # fmt: skip
        raise AssertionError("unreachable")
