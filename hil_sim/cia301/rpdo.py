"""PDOs that the virtual drive receives (CiA 301).

Synchronous ones (types 0 to 240) wait for the next SYNC; types 254 and 255 act on reception. All
values of a SYNC, or of a frame of type 254 or 255, are stored before any of them acts; the
controlword acts last, wherever it is mapped. An RPDO with an event timer must be received again
within it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from canopen import SdoAbortedError

from hil_sim.cia301.dictionary import Dictionary, Value, key
from hil_sim.cia301.pdo import Pdo
from hil_sim.ports import CanSegment, Timer

LENGTH_SHORT, LENGTH_LONG = 0x8210, 0x8220  # EMCY codes

Hooks = tuple[tuple[int, Callable[[int], None]], ...]
"""What acts on a write, each with the key of its object."""


def order_hooks(hooks: Hooks, last: tuple[int, ...]) -> Hooks:
    """Keep one hook per object; those of `last` go last, in its order."""
    by_key = dict(hooks)
    late = tuple((k, by_key.pop(k)) for k in last if k in by_key)
    return (*by_key.items(), *late)


class RpdoOwner(Protocol):
    """What an RPDO needs of its node."""

    def emergency(self, code: int) -> None:
        """Send an EMCY for an error that passes by itself."""

    def in_window(self) -> bool:
        """Whether a synchronous RPDO received now counts (0x1007)."""

    def on_rpdo_timeout(self) -> None:
        """Handle an RPDO that was not received within its event timer."""


class Rpdo(Pdo):
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

    # stagectl-linear-drive-csp.dcf: the controlword acts, two setpoints are stored
    first, second, third = keys
    act = hooks[0][1]

    def write_three(data: bytes) -> None:
        word, values[second], values[third] = unpack(data)
        values[first] = word
        act(word)

    return write_three
