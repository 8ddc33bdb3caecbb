"""Process data objects of the virtual drive: parameters, mapping, packing (CiA 301).

Synchronous TPDOs (types 1 to 240) are sampled at their SYNC, type 0 is sent if the data has
changed. Synchronous RPDOs (0 to 240) wait for the next SYNC. Types 254 and 255 act on reception and
are sent on an event of the device profile (statusword or mode display changed) or of the event
timer, at most once per inhibit time. All values of a SYNC, or of a frame of type 254 or 255, are
stored before any of them acts; the controlword acts last, wherever it is mapped. An RPDO with an
event timer must be received again within it.

The mapping is changed in the order that CiA 301 demands: PDO invalid (bit 31), count 0, entries,
count, PDO valid. Not supported: RTR (252, 253), dummy entries, multiplexed PDOs. A PDO that is made
valid with nothing mapped does nothing. Bit 30 (no RTR) is stored as written, because some masters
clear it without ever requesting by RTR.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from canopen import SdoAbortedError
from canopen.objectdictionary import datatypes
from canopen.sdo import constants as abort

from hil_sim.cia301.dictionary import Dictionary, Value, key
from hil_sim.ports import CanSegment, Timer

_ENTRIES = range(1, 9)
_INVALID, _NO_RTR, _EXTENDED = 1 << 31, 1 << 30, 1 << 29
_SYNCHRONOUS = range(241)
EVENT = (254, 255)

LENGTH_SHORT, LENGTH_LONG = 0x8210, 0x8220  # EMCY codes

_CODES = {
    datatypes.INTEGER8: "b", datatypes.UNSIGNED8: "B",
    datatypes.INTEGER16: "h", datatypes.UNSIGNED16: "H",
    datatypes.INTEGER32: "i", datatypes.UNSIGNED32: "I",
    datatypes.INTEGER64: "q", datatypes.UNSIGNED64: "Q",
    datatypes.REAL32: "f", datatypes.REAL64: "d",
}  # fmt: skip

Hooks = tuple[tuple[int, Callable[[int], None]], ...]
"""What acts on a write, each with the key of its object."""


def order_hooks(hooks: Hooks, last: tuple[int, ...]) -> Hooks:
    """Keep one hook per object; those of `last` go last, in its order."""
    by_key = dict(hooks)
    late = tuple((k, by_key.pop(k)) for k in last if k in by_key)
    return (*by_key.items(), *late)


def _is_restricted(cob_id: int) -> bool:
    """Whether CiA 301 reserves this COB-ID, so that no PDO may use it."""
    return (
        cob_id < 0x081
        or 0x101 <= cob_id <= 0x180
        or 0x581 <= cob_id <= 0x5FF
        or 0x601 <= cob_id <= 0x67F
        or 0x6E0 <= cob_id
    )


class _Pdo:
    """What RPDO and TPDO share: parameters, mapping rules, codec."""

    receive: bool

    def __init__(self, dictionary: Dictionary, communication: int, mapping: int) -> None:
        self.dictionary = dictionary
        self.mapping = mapping
        self.cob_key = key(communication, 1)
        self.type_key = key(communication, 2)
        self.cob_id = 0
        self.valid = False
        self.transmission = 1
        self.keys: tuple[int, ...] = ()
        self.codec = struct.Struct("<")
        check = dictionary.check
        check[self.cob_key] = self._check_cob
        check[self.type_key] = self._check_type
        check[key(mapping, 0)] = self._check_count
        for sub in _ENTRIES:
            check[key(mapping, sub)] = self._check_entry

    def compile(self) -> None:
        """Read the parameters from the dictionary."""
        values = self.dictionary
        cob = values.integer(self.cob_key)
        self.cob_id = cob & 0x7FF
        self.transmission = values.integer(self.type_key)
        variables = [
            self._variable(values.integer(key(self.mapping, sub)))
            for sub in range(1, values.integer(key(self.mapping, 0)) + 1)
        ]
        self.keys = tuple(key(v.index, v.subindex) for v in variables)
        self.codec = struct.Struct("<" + "".join(_CODES[v.data_type] for v in variables))
        self.valid = not cob & _INVALID and bool(self.keys)

    def _variable(self, entry: int) -> Any:
        return self.dictionary.mappable(
            entry >> 16, entry >> 8 & 0xFF, entry & 0xFF, receive=self.receive
        )

    def _exists(self) -> bool:
        return not self.dictionary.integer(self.cob_key) & _INVALID

    def _check_cob(self, value: int) -> None:
        identifier = value & 0x1FFFFFFF
        changed = value ^ self.dictionary.integer(self.cob_key)
        if self._exists() and not value & _INVALID and changed & ~_NO_RTR:
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)
        if value & _EXTENDED or identifier > 0x7FF:
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)
        if not value & _INVALID and _is_restricted(identifier):
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)

    def _check_type(self, value: int) -> None:
        if value not in _SYNCHRONOUS and value not in EVENT:
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)

    def _check_entry(self, value: int) -> None:
        if self._exists() or self.dictionary.integer(key(self.mapping, 0)):
            raise SdoAbortedError(abort.ABORT_UNSUPPORTED_ACCESS)
        if value:
            self._variable(value)

    def _check_count(self, value: int) -> None:
        if self._exists():
            raise SdoAbortedError(abort.ABORT_UNSUPPORTED_ACCESS)
        if value > len(_ENTRIES):
            raise SdoAbortedError(abort.ABORT_PDO_LENGTH_EXCEEDED)
        entries = [self.dictionary.integer(key(self.mapping, s)) for s in range(1, value + 1)]
        for entry in entries:
            self._variable(entry)  # an empty entry is an absent object
        if sum(entry & 0xFF for entry in entries) > 64:
            raise SdoAbortedError(abort.ABORT_PDO_LENGTH_EXCEEDED)


class RpdoOwner(Protocol):
    """What an RPDO needs of its node."""

    def emergency(self, code: int) -> None:
        """Send an EMCY for an error that passes by itself."""

    def in_window(self) -> bool:
        """Whether a synchronous RPDO received now counts (0x1007)."""

    def on_rpdo_timeout(self) -> None:
        """Handle an RPDO that was not received within its event timer."""


class Rpdo(_Pdo):
    """A PDO that the drive receives.

    Attributes:
        pending: payload that waits for the SYNC.
        windowed: only a frame within the SYNC window counts.
        apply: stores a frame's values, then calls the hooks; made by `compile`.
        store: only stores them; returns the hooks to call.
    """

    receive = True

    def __init__(
        self, dictionary: Dictionary, number: int, engine: RpdoOwner, segment: CanSegment
    ) -> None:
        super().__init__(dictionary, 0x1400 + number, 0x1600 + number)
        self.deadline_key = key(0x1400 + number, 5)
        self.pending: bytes | None = None
        self.windowed = False
        self._engine = engine
        self._segment = segment
        self._deadline_ns = 0
        self._due_ns = 0
        self._timer: Timer | None = None
        self._reported = False
        self.apply: Callable[[bytes], None] = self._apply_guarded
        self.store: Callable[[bytes], Hooks] = self._store_guarded
        self._hooks: Hooks = ()

    def compile(self) -> None:
        """Read the parameters from the dictionary."""
        super().compile()
        self.stop()
        self._reported = False
        d = self.dictionary
        self._deadline_ns = d.integer(self.deadline_key) * 1_000_000
        hooks = tuple((k, d.on_write[k]) for k in self.keys if k in d.on_write)
        self._hooks = order_hooks(hooks, d.act_last)
        guarded = any(
            k in d.check or d.variables[k].min is not None or d.variables[k].max is not None
            for k in self.keys
        )
        if guarded:
            self.store, self.apply = self._store_guarded, self._apply_guarded
        else:
            self.store = _storer(d.values, self.keys, self.codec.unpack, self._hooks)
            self.apply = _writer(d.values, self.keys, self.codec.unpack, self._hooks)

    def stop(self) -> None:
        """Discard what is pending, and stop the event timer."""
        self.pending = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def on_frame(self, data: bytes) -> None:
        """Keep the frame for the SYNC, or act at once for types 254 and 255."""
        if len(data) != self.codec.size:
            short = len(data) < self.codec.size
            if not self._reported:  # once per configuration, not at every SYNC
                self._reported = True
                self._engine.emergency(LENGTH_SHORT if short else LENGTH_LONG)
            if short:
                return
            data = data[: self.codec.size]
        if self._deadline_ns:
            self._due_ns = self._segment.now_ns + self._deadline_ns
            if self._timer is None:
                self._timer = self._segment.at(self._due_ns, self._on_deadline)
        if self.transmission > 240:
            self.apply(data)
        elif not self.windowed or self._engine.in_window():
            self.pending = data

    def _store_guarded(self, data: bytes) -> Hooks:
        values = self.dictionary.values
        taken = {
            k: value
            for k, value in zip(self.keys, self.codec.unpack(data), strict=True)
            if self._accepts(k, value)
        }
        values.update(taken)
        return tuple((k, hook) for k, hook in self._hooks if k in taken)

    def _apply_guarded(self, data: bytes) -> None:
        values = self.dictionary.values
        for k, hook in self._store_guarded(data):
            hook(values[k])  # type: ignore[arg-type]

    def _on_deadline(self) -> None:
        if self._segment.now_ns < self._due_ns:  # received meanwhile
            self._timer = self._segment.at(self._due_ns, self._on_deadline)
            return
        self._timer = None  # until the next frame
        self._engine.on_rpdo_timeout()

    def _accepts(self, k: int, value: int) -> bool:
        variable = self.dictionary.variables[k]
        if variable.min is not None and value < variable.min:
            return False
        if variable.max is not None and value > variable.max:
            return False
        check = self.dictionary.check.get(k)
        if check is not None:
            try:
                check(value)
            except SdoAbortedError:
                return False
        return True


class Tpdo(_Pdo):
    """A PDO that the drive sends.

    Attributes:
        sample: reads the mapped objects and packs them; made by `compile`.
    """

    receive = False

    def __init__(self, dictionary: Dictionary, number: int, segment: CanSegment) -> None:
        super().__init__(dictionary, 0x1800 + number, 0x1A00 + number)
        self._segment = segment
        self._inhibit_key = key(0x1800 + number, 3)
        self._event_key = key(0x1800 + number, 5)
        dictionary.check[self._inhibit_key] = self._check_inhibit
        self.sample: Callable[[], bytes] = bytes
        self._sync_count = 0
        self._last: bytes | None = None
        self._last_ns = -(1 << 62)
        self._timer: Timer | None = None
        self._deferred: Timer | None = None

    def compile(self) -> None:
        """Read the parameters from the dictionary."""
        super().compile()
        live, values = self.dictionary.live, self.dictionary.values
        self.sample = _sampler(
            self.codec.pack,
            [live.get(k) or partial(values.__getitem__, k) for k in self.keys],
        )
        self._sync_count = 0

    def start(self) -> None:
        """Start: the node has become operational, or the PDO has been changed."""
        self.stop()
        if self.valid and self.transmission in EVENT:
            self._send_event()

    def stop(self) -> None:
        """Stop the timers."""
        for timer in (self._timer, self._deferred):
            if timer is not None:
                timer.cancel()
        self._timer = self._deferred = None

    def on_sync(self) -> None:
        """Sample and send, if this SYNC is one of this PDO's."""
        if self.transmission == 1:
            self._segment.emit(self.cob_id, self.sample())
            return
        if self.transmission > 1:
            self._sync_count += 1
            if self._sync_count < self.transmission:
                return
            self._sync_count = 0
        data = self.sample()
        if self.transmission == 0:
            if data == self._last:
                return
            self._last = data
        self._segment.emit(self.cob_id, data)

    def on_event(self) -> None:
        """Send for an event of the device profile, after the inhibit time."""
        inhibit_ns = self.dictionary.integer(self._inhibit_key) * 100_000
        if self._segment.now_ns - self._last_ns >= inhibit_ns:
            self._send_event()
        elif self._deferred is None:
            self._deferred = self._segment.at(self._last_ns + inhibit_ns, self._send_event)

    def _send_event(self) -> None:
        self.stop()
        now = self._last_ns = self._segment.now_ns
        self._segment.emit(self.cob_id, self.sample())
        period_ns = self.dictionary.integer(self._event_key) * 1_000_000
        if period_ns:
            self._timer = self._segment.at(now + period_ns, self._send_event)

    def _check_inhibit(self, value: int) -> None:
        if self._exists():
            raise SdoAbortedError(abort.ABORT_INVALID_VALUE)


def _storer(
    values: dict[int, Value],
    keys: tuple[int, ...],
    unpack: Callable[[bytes], tuple[Any, ...]],
    hooks: Hooks,
) -> Callable[[bytes], Hooks]:
    """Make `store` of an RPDO whose objects accept any value."""

    def store(data: bytes) -> Hooks:
        values.update(zip(keys, unpack(data), strict=True))
        return hooks

    return store


def _writer(
    values: dict[int, Value],
    keys: tuple[int, ...],
    unpack: Callable[[bytes], tuple[Any, ...]],
    hooks: Hooks,
) -> Callable[[bytes], None]:
    """Make `apply` of such an RPDO; it runs at every SYNC."""

    def write(data: bytes) -> None:
        values.update(zip(keys, unpack(data), strict=True))
        for k, hook in hooks:
            hook(values[k])  # type: ignore[arg-type]

    if len(keys) != 3 or len(hooks) != 1 or hooks[0][0] != keys[0]:
        return write

    # the mapping of our own driver: the controlword acts, two setpoints are stored
    first, second, third = keys
    act = hooks[0][1]

    def write_three(data: bytes) -> None:
        word, values[second], values[third] = unpack(data)
        values[first] = word
        act(word)

    return write_three


def _sampler(pack: Callable[..., bytes], readers: list[Callable[[], Any]]) -> Callable[[], bytes]:
    """Make `sample` of a TPDO; it runs at every SYNC."""
    if len(readers) == 3:  # the mapping of our own driver
        first, second, third = readers
        return lambda: pack(first(), second(), third())
    return lambda: pack(*[read() for read in readers])
