"""PDOs that the virtual drive receives (CiA 301).

Synchronous ones (types 0 to 240) wait for the next SYNC; types 254 and 255 act on reception. All
values of a SYNC, or of a frame of type 254 or 255, are stored before any of them acts; the
controlword acts last, wherever it is mapped. An RPDO with an event timer must be received again
within it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from canopen import SdoAbortedError

from hil_sim.cia301.object_dictionary import Dictionary, Value, key
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


class Rpdo(Pdo):
    """A PDO that the drive receives.

    Args:
        dictionary: of the drive.
        number: 0..3.
        segment: the bus.
        act: calls hooks with the values of their objects.
        is_in_window: whether a frame for the next SYNC counts now (0x1007).
        announce: sends an EMCY for an error that passes by itself.
        on_timeout: called when the PDO was not received within its event timer.

    Attributes:
        pending: payload that waits for the SYNC.
        apply: stores a frame's values and acts on them; made by `compile`.
    """

    receive = True

    def __init__(
        self,
        dictionary: Dictionary,
        number: int,
        segment: CanSegment,
        act: Callable[[Hooks], None],
        is_in_window: Callable[[], bool],
        announce: Callable[[int], None],
        on_timeout: Callable[[], None],
    ) -> None:
        super().__init__(dictionary, 0x1400 + number, 0x1600 + number)
        self.deadline_key = key(0x1400 + number, 5)
        self.pending: bytes | None = None
        self._segment = segment
        self._act, self._is_in_window = act, is_in_window
        self._announce, self._on_timeout = announce, on_timeout
        self._deadline_ns = 0
        self._due_ns = 0
        self._timer: Timer | None = None
        self._reported = False
        self._hooks: Hooks = ()
        self._is_guarded = False
        self.apply: Callable[[bytes], None] = self._apply

    def compile(self) -> None:
        """Read the parameters from the dictionary."""
        super().compile()
        self.stop()
        self._reported = False
        d = self.dictionary
        self._deadline_ns = d.integer(self.deadline_key) * 1_000_000
        self._hooks = tuple((k, d.on_write[k]) for k in self.keys if k in d.on_write)
        self._is_guarded = any(
            k in d.check or d.variables[k].min is not None or d.variables[k].max is not None
            for k in self.keys
        )
        self.apply = self._apply
        if not self._is_guarded and len(self.keys) == 3 and len(self._hooks) == 1:
            (k, hook) = self._hooks[0]
            if k == self.keys[0]:
                self.apply = _csp_writer(d.values, self.keys, self.codec.unpack, hook)

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
                self._announce(LENGTH_SHORT if short else LENGTH_LONG)
            if short:
                return
            data = data[: self.codec.size]
        if self._deadline_ns:
            self._due_ns = self._segment.now_ns + self._deadline_ns
            if self._timer is None:
                self._timer = self._segment.at(self._due_ns, self._on_deadline)
        if self.transmission > 240:
            self.apply(data)
        elif self._is_in_window():
            self.pending = data

    def _apply(self, data: bytes) -> None:
        self._act(self.store(data))

    def store(self, data: bytes) -> Hooks:
        """Store the values that the objects accept; what is to act on them."""
        values = self.dictionary.values
        received = zip(self.keys, self.codec.unpack(data), strict=True)
        if not self._is_guarded:
            values.update(received)
            return self._hooks
        taken = {k: value for k, value in received if self._accepts(k, value)}
        values.update(taken)
        return tuple((k, hook) for k, hook in self._hooks if k in taken)

    def _on_deadline(self) -> None:
        if self._segment.now_ns < self._due_ns:  # received meanwhile
            self._timer = self._segment.at(self._due_ns, self._on_deadline)
            return
        self._timer = None  # until the next frame
        self._on_timeout()

    def _accepts(self, k: int, value: int) -> bool:
        try:
            self.dictionary.check_value(k, value)
        except SdoAbortedError:
            return False
        return True


def _csp_writer(
    values: dict[int, Value],
    keys: tuple[int, ...],
    unpack: Callable[[bytes], tuple[Any, ...]],
    act: Callable[[int], None],
) -> Callable[[bytes], None]:
    """Make `apply` for stagectl-linear-drive-csp.dcf, at every SYNC: controlword, two setpoints."""
    first, second, third = keys

    def write(data: bytes) -> None:
        word, values[second], values[third] = unpack(data)
        values[first] = word
        act(word)

    return write
