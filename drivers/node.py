"""One CANopen node: NMT, boot-up, identity, SDO access with checks, heartbeat and EMCY watch.

The object dictionary comes from canopen; what is added here is errors that name axis and object,
one retry of a lost SDO, read-back, and alarms kept for the cyclic path to look at (callbacks never
raise and never talk).
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import canopen

from drivers import objects as od
from drivers.bus import Network
from drivers.errors import ConfigurationError, NodeError
from drivers.faults import error_text, register_text
from drivers.objects import ObjectRef
from drivers.sdo_channel import SdoChannel
from drivers.settings import HOST_NODE, AxisSettings

T = TypeVar("T")
Value = int | float | str | bytes | bytearray
"""Of an object, by its data type."""

BOOT_TIMEOUT = 2.0
"""How long a node may take from the reset of its communication to its boot-up message [s]."""
SDO_TIMEOUT = 0.4
SDO_ATTEMPTS = 2
REBOOTED = "the drive rebooted (boot-up message): its set-up is lost"
HEARTBEAT_PRODUCER_MS = 100
HEARTBEAT_DEADLINE_NS = 350_000_000
HEARTBEAT_CONSUMER_MS = 500

_OPERATIONAL, _PRE_OPERATIONAL = 5, 127
_NMT_STATES = {4: "STOPPED", 5: "OPERATIONAL", 127: "PRE-OPERATIONAL"}
_NOT_OFFERED = (0x06020000, 0x06090011)


@dataclass(frozen=True, slots=True)
class Alarm:
    """Something a node said, or did not say, that must stop the axes.

    Attributes:
        cause: one clause.  code: EMCY error code, None for other alarms.
    """

    cause: str
    code: int | None = None


def load_dictionary(settings: AxisSettings) -> canopen.ObjectDictionary:
    """The object dictionary in the axis' EDS.

    Raises:
        ConfigurationError: the file is missing or cannot be read as an EDS.
    """
    if not settings.eds.is_file():
        raise ConfigurationError(f"EDS file {settings.eds}: no such file", axis=settings.name)
    try:
        dictionary = canopen.import_od(str(settings.eds), settings.node)
    except Exception as why:  # its parser raises whatever int() and configparser do
        reason = " ".join(str(why).split()) or type(why).__name__
        raise ConfigurationError(f"EDS file {settings.eds}: {reason}", axis=settings.name) from why
    if 0x1018 not in dictionary:
        raise ConfigurationError(
            f"EDS file {settings.eds}: has no identity object 0x1018", axis=settings.name
        )
    return dictionary


class Node:
    """A remote node.

    Attributes:
        name: of its axis.  id: node id.
        alarm: the first alarm since `clear_alarms`, None when there was none.
        watched: whether silence, a reboot or leaving OPERATIONAL is an alarm.
        silent: it did not answer an SDO, and nothing was heard of it since.
        booted: number of boot-up messages seen.
        emergencies: EMCY error codes since `clear_alarms`, oldest first.
    """

    def __init__(self, network: Network, settings: AxisSettings) -> None:
        self.name = settings.name
        self.id = settings.node
        self.alarm: Alarm | None = None
        self.watched = self.silent = False
        self.booted = 0
        self.emergencies: deque[int] = deque(maxlen=8)
        self.state: int | None = None
        self._heard_ns = network.clock.now_ns()
        self._network = network
        self._dictionary = load_dictionary(settings)
        self._sdo = SdoChannel(network, settings.node, SDO_TIMEOUT)
        network.subscribe(0x700 + self.id, self._on_heartbeat)
        network.subscribe(0x80 + self.id, self._on_emergency)
        network.watchers.append(self._watch)
        self.on_alarm: Callable[[Node], None] | None = None

    # -- what the node says -----------------------------------------------------------------

    def _on_heartbeat(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) != 1:
            return
        self._heard_ns = self._network.clock.now_ns()
        self.silent = False
        state = data[0] & 0x7F
        self.state = _PRE_OPERATIONAL if state == 0 else state
        if state == 0:
            self.booted += 1
            if self.watched:
                self._raise(Alarm(REBOOTED))
        elif self.watched and state != _OPERATIONAL:
            self._raise(Alarm(f"NMT state is {_NMT_STATES.get(state, state)}, not OPERATIONAL"))

    def _on_emergency(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) < 3:
            return
        self.silent = False
        code, register = struct.unpack_from("<HB", data)
        if code & 0xFF00:
            self.emergencies.append(code)
            text = f"emergency: {error_text(code)}, error register: {register_text(register)}"
            self._raise(Alarm(text, code))

    def _watch(self, now: int) -> None:
        if self.watched and now - self._heard_ns > HEARTBEAT_DEADLINE_NS:
            silent = (now - self._heard_ns) / 1e9
            self._raise(Alarm(f"heartbeat lost: node {self.id} silent for {silent:.2f} s"))

    def _raise(self, alarm: Alarm) -> None:
        # the first one is the cause; later ones are its consequences
        if self.alarm is None:
            self.alarm = alarm
            if self.on_alarm is not None:
                self.on_alarm(self)

    def clear_alarms(self) -> None:
        """Forgets what was said so far; the heartbeat deadline starts anew."""
        self.alarm = None
        self.emergencies.clear()
        self._heard_ns = self._network.clock.now_ns()

    @property
    def nmt_state(self) -> str | None:
        """NMT state from the last heartbeat, None before the first."""
        return None if self.state is None else _NMT_STATES.get(self.state, str(self.state))

    # -- NMT --------------------------------------------------------------------------------

    def boot(self) -> None:
        """Resets the node's communication, waits for its boot-up, checks who it is.

        Raises:
            NodeError: no boot-up within `BOOT_TIMEOUT`, or another device than the EDS describes.
        """
        self.watched = False
        before = self.booted
        # communication only: the application keeps its power stage off and its encoder reference
        self._network.send_message(0, (130, self.id))
        if not self._network.pump_until(lambda: self.booted > before, BOOT_TIMEOUT):
            raise NodeError(
                f"no boot-up message from node {self.id} within {BOOT_TIMEOUT:g} s: "
                "is the drive on, on this bus and at this bit rate?",
                axis=self.name,
            )
        self.clear_alarms()
        self._check_identity()

    def _check_identity(self) -> None:
        info = self._dictionary.device_information
        for ref, from_info in (
            (od.VENDOR_ID, info.vendor_number),
            (od.PRODUCT_CODE, info.product_number),
        ):
            variable = self._dictionary.get_variable(ref.index, ref.sub)
            expected = variable.default if variable is not None else None
            expected = from_info if expected is None else expected
            if expected is None:
                continue
            found = self.read(ref)
            if found != expected:
                raise NodeError(
                    f"is 0x{found:08X}, the EDS describes 0x{expected:08X}: another device",
                    axis=self.name, obj=ref,
                )  # fmt: skip
        revision = self._dictionary.get_variable(0x1018, od.REVISION.sub)
        if revision is not None and revision.default is not None:
            # the major number stands for the CANopen behaviour, the minor one for the firmware
            described, found = revision.default >> 16, self.read(od.REVISION) >> 16
            if found != described:
                raise NodeError(
                    f"major revision is {found}, the EDS describes {described}",
                    axis=self.name, obj=od.REVISION,
                )  # fmt: skip
        kind = self.read(od.DEVICE_TYPE) & 0xFFFF
        if kind != 402:
            raise NodeError(
                f"is profile {kind}, not a CiA 402 drive", axis=self.name, obj=od.DEVICE_TYPE
            )

    def set_heartbeats(self) -> None:
        """Sets the node's heartbeat, and has it watch the host's."""
        self.write_checked(od.HEARTBEAT_PRODUCER, HEARTBEAT_PRODUCER_MS)
        self.write_optional(od.HEARTBEAT_CONSUMER, HOST_NODE << 16 | HEARTBEAT_CONSUMER_MS)

    def start(self) -> None:
        """NMT start, and wait for a heartbeat that confirms OPERATIONAL.

        Raises:
            NodeError: the node does not become OPERATIONAL.
        """
        self.state = None
        self._network.send_message(0, (1, self.id))
        wait = 5 * HEARTBEAT_PRODUCER_MS * 1e-3
        if not self._network.pump_until(lambda: self.state == _OPERATIONAL, wait):
            raise NodeError(
                f"node {self.id} did not become OPERATIONAL within {wait:g} s "
                f"(heartbeat says {_NMT_STATES.get(self.state or 0, 'nothing')})",
                axis=self.name,
            )
        self.clear_alarms()
        self.watched = True

    def release(self) -> None:
        """Puts the node back to PRE-OPERATIONAL without heartbeat watch over the host."""
        self.watched = False
        if self.offers(od.HEARTBEAT_CONSUMER):
            self.write(od.HEARTBEAT_CONSUMER, 0)
        self._network.send_message(0, (128, self.id))

    def detach(self) -> None:
        """Stops listening to the node."""
        self.watched = False
        if self._watch in self._network.watchers:
            self._network.watchers.remove(self._watch)
        self._sdo.detach()

    # -- SDO --------------------------------------------------------------------------------

    def offers(self, obj: ObjectRef) -> bool:
        """Whether the EDS lists the object."""
        return self._variable(obj) is not None

    def has(self, obj: ObjectRef) -> bool:
        """Whether the EDS lists the object and the node lets it be read.

        Raises:
            NodeError: no answer.
        """
        if not self.offers(obj):
            return False
        try:
            self.read(obj)
        except NodeError as refused:
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

    def read(self, obj: ObjectRef) -> int:
        """Reads an integer object by SDO.

        Raises:
            NodeError: no answer, or the node aborts the access.
        """
        data = self._attempt("read", obj, lambda: self._sdo.upload(obj.index, obj.sub))
        variable = self._variable(obj)
        if variable is not None and len(data) * 8 > len(variable) >= 8:
            data = data[: len(variable) // 8]  # some drives send four bytes for any number
        if variable is None or len(data) * 8 != len(variable):
            return int.from_bytes(data, "little")
        return int(variable.decode_raw(data))

    def error_history(self, length: int) -> tuple[int, ...]:
        """The newest error codes of 0x1003, newest first; empty where the node keeps none.

        Raises:
            NodeError: no answer.
        """
        codes = []
        try:
            count = self.read(od.ERROR_COUNT) if self.offers(od.ERROR_COUNT) else 0
            for sub in range(1, min(count, length) + 1):
                codes.append(self.read(ObjectRef(0x1003, sub, "error history")) & 0xFFFF)
        except NodeError as refused:
            if refused.abort_code is None:
                raise
        return tuple(codes)

    def read_value(self, obj: ObjectRef) -> Value:
        """Reads an object of any type by SDO, bytes where the EDS says nothing of its type.

        Raises:
            NodeError: as `read`, or the answer is not of the object's type.
        """
        data = self._attempt("read", obj, lambda: self._sdo.upload(obj.index, obj.sub))
        variable = self._variable(obj)
        try:
            return data if variable is None else variable.decode_raw(data)
        except canopen.ObjectDictionaryError as why:
            raise NodeError(
                f"read: {len(data)} bytes are not of its type", axis=self.name, obj=obj
            ) from why

    def write(self, obj: ObjectRef, value: Value) -> None:
        """Writes an object by SDO.

        Raises:
            ConfigurationError: the EDS does not list the object, or the value does not fit it.
            NodeError: no answer, or the node aborts the access.
        """
        data = self._encoded(obj, value)
        self._attempt(
            f"write of {value!r}",
            obj,
            lambda: self._sdo.download(obj.index, obj.sub, data),
        )

    def tell(self, obj: ObjectRef, value: int) -> None:
        """Sends a write and waits for no answer: for a stop, to who doesn't answer but may listen.

        Raises:
            ConfigurationError: as `write`.
            BusError: the bus does not take it.
        """
        self._sdo.tell(obj.index, obj.sub, self._encoded(obj, value))

    def write_checked(self, obj: ObjectRef, value: int) -> None:
        """Writes an object and reads it back.

        Raises:
            ConfigurationError: the drive holds another value afterwards.
            NodeError: as `read` and `write`.
        """
        self.write(obj, value)
        held = self.read(obj)
        if held != value:
            raise ConfigurationError(
                f"wrote {value}, the drive holds {held}", axis=self.name, obj=obj
            )

    def write_optional(self, obj: ObjectRef, value: int) -> bool:
        """Writes and reads back an object that a drive may do without.

        Returns:
            False where neither EDS nor node offer it.

        Raises:
            ConfigurationError, NodeError: as `write_checked`, where it is offered.
        """
        if not self.offers(obj):
            return False
        try:
            self.write_checked(obj, value)
        except NodeError as refused:
            if refused.abort_code in _NOT_OFFERED:
                return False
            raise
        return True

    @property
    def dictionary(self) -> canopen.ObjectDictionary:
        """What the EDS says."""
        return self._dictionary

    def _variable(self, obj: ObjectRef) -> canopen.objectdictionary.ODVariable | None:
        return self._dictionary.get_variable(obj.index, obj.sub)

    def _encoded(self, obj: ObjectRef, value: Value) -> bytes:
        variable = self._variable(obj)
        if variable is None:
            raise ConfigurationError("the EDS does not list it", axis=self.name, obj=obj)
        try:
            return bytes(variable.encode_raw(value))
        except (struct.error, ValueError, OverflowError, TypeError) as why:
            raise ConfigurationError(
                f"{value!r} does not fit the object: {why}", axis=self.name, obj=obj
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
                raise NodeError(
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
