"""PDOs that the virtual drive sends (CiA 301).

Synchronous ones (types 1 to 240) are sampled at their SYNC, type 0 is sent if the data has changed.
Types 254 and 255 are sent on an event of the device profile (statusword or mode display changed) or
of the event timer, at most once per inhibit time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from hil_sim.cia301.object_dictionary import Dictionary, key, require
from hil_sim.cia301.pdo import EVENT, Pdo
from hil_sim.ports import CanSegment, Timer


class Tpdo(Pdo):
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
        dictionary.check[self._inhibit_key] = lambda _: require(not self.exists())
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
        readers = [live.get(k) or partial(values.__getitem__, k) for k in self.keys]
        self.sample = _sampler(self.codec.pack, readers)
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


def _sampler(pack: Callable[..., bytes], readers: list[Callable[[], Any]]) -> Callable[[], bytes]:
    """Make `sample` of a TPDO; it runs at every SYNC."""
    if len(readers) == 3:  # stagectl-linear-drive-csp.dcf
        first, second, third = readers
        return lambda: pack(first(), second(), third())
    return lambda: pack(*[read() for read in readers])
