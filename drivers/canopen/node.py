"""One CANopen node: NMT, boot-up, identity, monitoring of heartbeat and EMCY.

Alarms are stored for the cyclic path to check: callbacks neither raise nor send. The node's objects
are in `remote_objects.py`.
"""

from __future__ import annotations

import struct
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from drivers import objects as od
from drivers.canopen.bus import Network
from drivers.canopen.emcy import error_text, register_text
from drivers.canopen.nmt import NMT_STATES
from drivers.canopen.remote_objects import RemoteObjects
from drivers.errors import AxisFault, ConfigurationError, NodeError, RefusedError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

SECOND_ANSWER = 0.005
"""A second device with the same node id answers within this time after the first [s]."""
REBOOTED = "the drive rebooted (boot-up message): its configuration is lost"
_HEARTBEATS = 3.5
"""Periods after which a node counts as silent."""

_ANSWERS = (0x40, 0x80)
"""Services of SDO answers to a request for an object: its value, an abort."""
_OPERATIONAL, _PRE_OPERATIONAL = 5, 127


class Node(RemoteObjects):
    """A remote node.

    Attributes:
        alarm: the first fault since `clear_alarms` that must stop the axes, None without one.
        watched: whether silence, a reboot or leaving OPERATIONAL is an alarm.
        booted: number of boot-up messages received.
        emergencies: EMCY error codes since `clear_alarms`, oldest first.
        warnings: what the drive warned of (EMCY with error register 0), one clause each.
    """

    def __init__(self, network: Network, settings: AxisSettings) -> None:
        super().__init__(network, settings)
        self._boot_timeout, self._revision = settings.boot_timeout, settings.revision
        self._heartbeat_ms = round(settings.heartbeat * 1000)
        self._stopping = frozenset(settings.warnings)
        self.alarm: AxisFault | None = None
        self.watched = False
        self.booted = self._booted_before = self._answers_at_boot = 0
        self.emergencies: deque[int] = deque(maxlen=8)
        self.warnings: list[str] = []
        self.state: int | None = None
        self._heard_ns = network.clock.now_ns()
        self._network = network
        network.subscribe(0x700 + self.id, self._on_heartbeat)
        network.subscribe(0x80 + self.id, self._on_emergency)
        network.watchers.append(self._watch)
        self.on_alarm: Callable[[Node], None] | None = None

    # -- monitoring -------------------------------------------------------------------------

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
                self._alarm(REBOOTED)
        elif self.watched and state != _OPERATIONAL:
            self._alarm(f"NMT state is {_in_words(state)}, not OPERATIONAL")

    def _on_emergency(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) < 3:
            return
        self.silent = False
        code, register = struct.unpack_from("<HB", data)
        if code & 0xFF00:
            if register == 0 and code not in self._stopping:
                warning = f"warns: {error_text(code)}, and goes on (error register 0)"
                if warning not in self.warnings:
                    self.warnings.append(warning)
                return
            self.emergencies.append(code)
            text = f"emergency: {error_text(code)}, error register: {register_text(register)}"
            self._alarm(text, code)

    def _watch(self, now: int) -> None:
        if self.watched and now - self._heard_ns > _HEARTBEATS * 1e6 * self._heartbeat_ms:
            silent = (now - self._heard_ns) / 1e9
            self._alarm(f"heartbeat lost: node {self.id} silent for {silent:.2f} s")

    def _alarm(self, cause: str, code: int | None = None) -> None:
        # the first alarm is the cause, later ones are its consequences
        if self.alarm is None:
            self.alarm = AxisFault(cause, axis=self.name, code=code)
            if self.on_alarm is not None:
                self.on_alarm(self)

    def clear_alarms(self) -> None:
        """Clears alarms and emergencies and restarts the heartbeat deadline."""
        self.alarm = None
        self.emergencies.clear()
        self._heard_ns = self._network.clock.now_ns()

    @property
    def nmt_state(self) -> str | None:
        """NMT state of the last heartbeat, None before the first."""
        return None if self.state is None else _in_words(self.state)

    # -- NMT --------------------------------------------------------------------------------

    def boot(self) -> None:
        """Resets the node's communication, waits for its boot-up and checks its identity.

        Raises:
            NodeError: no boot-up in time, or a device other than the EDS describes.
        """
        self.watched = False
        self._network.pump(0.0)  # an earlier boot-up message does not answer our reset
        before = self._booted_before = self.booted
        # communication only: the encoder reference is kept
        self._network.send_message(0, (130, self.id))
        if not self._network.pump_until(lambda: self.booted > before, self._boot_timeout):
            raise NodeError(
                f"no boot-up message from node {self.id} within {self._boot_timeout:g} s: "
                "is the drive on, on this bus and at this bit rate?",
                axis=self.name,
            )
        self.clear_alarms()
        with self._counted_answers() as answers:
            self._check_identity()
        self._answers_at_boot = max(answers.values())

    def seen_double(self) -> NodeError | None:
        """As `find_double`, by what was received in `boot` and since; nothing is sent."""
        return self._double(self._answers_at_boot)

    def find_double(self) -> NodeError | None:
        """Evidence since `boot` of two devices with this node id; None: there is none.

        A bus may duplicate a frame now and then, and a drive may restart while it is configured; of
        two devices there is evidence every time.

        Raises:
            NodeError: no answer.
        """
        with self._counted_answers() as answers:
            self.read(od.DEVICE_TYPE)
            self._network.pump(SECOND_ANSWER)
        return self._double(max(answers.values()))

    def _double(self, answers: int) -> NodeError | None:
        """By the boot-up messages since `boot`, and the answers to one SDO request."""
        booted = self.booted - self._booted_before
        if booted > 1:
            what = f"{booted} boot-up messages after one reset"
        elif answers > 1:
            what = f"{answers} answers to one SDO request"
        else:
            return None
        return NodeError(
            f"{what}: do two devices have node id {self.id}? (stagectl scan)", axis=self.name
        )

    @contextmanager
    def _counted_answers(self) -> Iterator[Counter[tuple[int, int]]]:
        """Counts the answers to each request inside, by object: 1, or more by other devices."""
        answers: Counter[tuple[int, int]] = Counter()
        before = self._sdo.asked.copy()

        def count(can_id: int, data: bytearray, timestamp: float) -> None:
            if len(data) == 8 and data[0] & 0xE0 in _ANSWERS:
                answers[data[1] | data[2] << 8, data[3]] += 1

        self._network.subscribe(0x580 + self.id, count)
        try:
            yield answers
        finally:
            self._network.unsubscribe(0x580 + self.id, count)
            for asked in answers:  # a lost answer is asked for again
                answers[asked] -= max(0, self._sdo.asked[asked] - before[asked] - 1)

    def _check_identity(self) -> None:
        info = self.dictionary.device_information
        for ref, from_info in (
            (od.VENDOR_ID, info.vendor_number),
            (od.PRODUCT_CODE, info.product_number),
        ):
            default = self._default(ref)
            expected = from_info if default is None else default
            if expected is not None and (found := self.read(ref)) != expected:
                raise NodeError(
                    f"is 0x{found:08X}, the EDS describes 0x{expected:08X}: another device",
                    axis=self.name, obj=ref,
                )  # fmt: skip
        # the major number denotes the CANopen behaviour, the minor number the firmware
        wanted, source = self._revision, "the settings require"
        if wanted is None and (revision := self._default(od.REVISION)) is not None:
            wanted, source = revision >> 16, "the EDS describes"
        if wanted is not None and (found := self.read(od.REVISION) >> 16) != wanted:
            raise NodeError(
                f"major revision is {found}, {source} {wanted}", axis=self.name, obj=od.REVISION
            )
        kind = self.read(od.DEVICE_TYPE) & 0xFFFF
        if kind != 402:
            raise NodeError(
                f"is profile {kind}, not a CiA 402 drive", axis=self.name, obj=od.DEVICE_TYPE
            )

    def _default(self, ref: ObjectRef) -> int | None:
        """An object's value in the EDS."""
        variable = self.dictionary.get_variable(ref.index, ref.sub)
        return None if variable is None else variable.default

    def set_heartbeat(self) -> None:
        """Has the node send heartbeats (0x1017).

        Raises:
            ConfigurationError: it refuses their period.
        """
        try:
            self.write_checked(od.HEARTBEAT_PRODUCER, self._heartbeat_ms)
        except (RefusedError, ConfigurationError) as error:
            raise ConfigurationError(
                f"{error.cause}; a drive that only takes longer periods needs heartbeat in its "
                f"drive section: 200 ms, and it may go on for {_HEARTBEATS * 0.2:g} s unnoticed",
                axis=self.name, obj=od.HEARTBEAT_PRODUCER,
            ) from error  # fmt: skip

    def start(self) -> None:
        """Sends NMT start and waits for a heartbeat that confirms OPERATIONAL.

        Raises:
            NodeError: the node does not become OPERATIONAL.
        """
        self.state = None
        self._network.send_message(0, (1, self.id))
        wait = 5 * self._heartbeat_ms * 1e-3
        if not self._network.pump_until(lambda: self.state == _OPERATIONAL, wait):
            raise NodeError(
                f"node {self.id} did not become OPERATIONAL within {wait:g} s "
                f"(heartbeat says {self.nmt_state or 'nothing'})",
                axis=self.name,
            )
        self.clear_alarms()
        self.watched = True

    def release(self) -> None:
        """Returns the node to PRE-OPERATIONAL; it no longer watches the host's heartbeat."""
        self.watched = False
        if self.offers(od.HEARTBEAT_CONSUMER):
            with suppress(NodeError):  # a drive may not support it
                self.write(od.HEARTBEAT_CONSUMER, 0)
        self._network.send_message(0, (128, self.id))

    def detach(self) -> None:
        """Stops listening to the node."""
        self.watched = False
        if self._watch in self._network.watchers:
            self._network.watchers.remove(self._watch)
        self._sdo.detach()


def _in_words(state: int) -> str:
    return NMT_STATES.get(state, str(state)).upper()
