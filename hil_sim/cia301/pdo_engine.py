"""All process data of a node: four RPDOs and four TPDOs, and what a SYNC does with them.

PDOs exist while the node is OPERATIONAL; `pdo` says what is supported.
"""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.cia301.dictionary import Dictionary, key
from hil_sim.cia301.pdo import EVENT
from hil_sim.cia301.rpdo import Hooks, Rpdo, order_hooks
from hil_sim.cia301.tpdo import Tpdo
from hil_sim.ports import CanSegment

COUNT = 4  # of each kind
_SYNC_WINDOW = key(0x1007)


class PdoEngine:
    """All PDOs of a node.

    Args:
        announce: sends the EMCY for an RPDO of the wrong length.
        on_timeout: called when an RPDO was not received within its event timer.

    Attributes:
        on_sync: sends the synchronous TPDOs that are due, then applies the synchronous RPDOs
            received since the last SYNC.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        segment: CanSegment,
        announce: Callable[[int], None],
        on_timeout: Callable[[], None],
    ) -> None:
        self._announce = announce
        self._on_timeout = on_timeout
        self._dictionary = dictionary
        self._segment = segment
        self._real_time = hasattr(segment, "sync_overtaken")
        self._running = False
        self._sync_ns = 0
        self._window_ns = 0
        self._subscribed: list[tuple[int, Rpdo]] = []
        self._rpdos = [Rpdo(dictionary, n, self, segment) for n in range(COUNT)]
        self._tpdos = [Tpdo(dictionary, n, segment) for n in range(COUNT)]
        self._sync_rpdos: tuple[Rpdo, ...] = ()
        self._several = False
        self._emit = segment.emit
        self.on_sync: Callable[[], None] = self._on_any_sync
        self._at_every_sync: tuple[tuple[int, Callable[[], bytes]], ...] = ()
        self._sync_tpdos: tuple[Tpdo, ...] = ()
        self._event_tpdos: tuple[Tpdo, ...] = ()
        dictionary.on_write[_SYNC_WINDOW] = lambda _: self._select_active()
        for pdo in (*self._rpdos, *self._tpdos):
            keys = [pdo.cob_key, pdo.type_key]
            if isinstance(pdo, Rpdo):
                keys.append(pdo.deadline_key)
            for k in keys:
                dictionary.on_write[k] = lambda _, pdo=pdo: self._changed(pdo)  # type: ignore[misc]

    def start(self) -> None:
        """Start: the node has become operational."""
        self._running = True
        for pdo in (*self._rpdos, *self._tpdos):
            pdo.compile()
        self._select_active()
        for tpdo in self._event_tpdos:
            tpdo.start()

    def stop(self) -> None:
        """Stop: the node has left operational; discard what is pending."""
        self._running = False
        for tpdo in self._tpdos:
            tpdo.stop()
        for rpdo in self._rpdos:
            rpdo.stop()
        self._select_active()

    def _on_any_sync(self) -> None:
        """As `on_sync`, whatever is mapped."""
        self._send()
        self.latch()

    def _send(self) -> None:
        # The host would take them for the answer to the next SYNC, which is on the bus already.
        if not (self._real_time and self._segment.sync_overtaken):  # type: ignore[attr-defined]
            for cob_id, sample in self._at_every_sync:
                self._emit(cob_id, sample())
            for tpdo in self._sync_tpdos:
                tpdo.on_sync()

    def latch(self) -> None:
        """Apply the synchronous RPDOs received since the last SYNC."""
        if self._several:
            self._latch_several()
        else:
            for rpdo in self._sync_rpdos:
                data = rpdo.pending
                if data is not None:
                    rpdo.pending = None
                    rpdo.apply(data)
        if self._window_ns:
            self._sync_ns = self._segment.now_ns

    def _latch_several(self) -> None:
        """Store the values of all pending RPDOs before any of them acts."""
        hooks: Hooks = ()
        for rpdo in self._sync_rpdos:
            data = rpdo.pending
            if data is not None:
                rpdo.pending = None
                hooks += rpdo.store(data)
        values = self._dictionary.values
        for k, hook in order_hooks(hooks, self._dictionary.act_last) if len(hooks) > 1 else hooks:
            hook(values[k])  # type: ignore[arg-type]

    def emergency(self, code: int) -> None:
        """Send an EMCY for an error that passes by itself."""
        self._announce(code)

    def on_rpdo_timeout(self) -> None:
        """Handle an RPDO that was not received in time."""
        self._on_timeout()

    def on_event(self) -> None:
        """Statusword or mode display has changed."""
        for tpdo in self._event_tpdos:
            tpdo.on_event()

    def in_window(self) -> bool:
        """Whether a synchronous RPDO received now counts (0x1007)."""
        return self._segment.now_ns - self._sync_ns <= self._window_ns

    def _changed(self, pdo: Rpdo | Tpdo) -> None:
        if not self._running:
            return
        pdo.compile()
        self._select_active()
        if isinstance(pdo, Tpdo):
            pdo.start()

    def _select_active(self) -> None:
        for cob_id, rpdo in self._subscribed:
            self._segment.unsubscribe(cob_id, rpdo.on_frame)
        live = self._running
        self._window_ns = self._dictionary.integer(_SYNC_WINDOW) * 1000
        for rpdo in self._rpdos:
            rpdo.windowed = self._window_ns > 0
        self._subscribed = [(r.cob_id, r) for r in self._rpdos if live and r.valid]
        for cob_id, rpdo in self._subscribed:
            self._segment.subscribe(cob_id, rpdo.on_frame)
        synchronous = [p for p in self._tpdos if live and p.valid and p.transmission <= 240]
        # the usual case saves a call per PDO; mixed types keep their order
        simple = all(p.transmission == 1 for p in synchronous)
        self._at_every_sync = tuple((p.cob_id, p.sample) for p in synchronous if simple)
        self._sync_tpdos = () if simple else tuple(synchronous)
        self._event_tpdos = tuple(
            p for p in self._tpdos if live and p.valid and p.transmission in EVENT
        )
        self._sync_rpdos = tuple(
            r for r in self._rpdos if live and r.valid and r.transmission <= 240
        )
        self._several = len(self._sync_rpdos) > 1
        one_of_each = len(self._at_every_sync) == len(self._sync_rpdos) == 1
        if one_of_each and not self._real_time and not self._window_ns:
            ((cob_id, sample),) = self._at_every_sync
            self.on_sync = _exchanger(self._emit, cob_id, sample, self._sync_rpdos[0])
        else:
            self.on_sync = self._on_any_sync


def _exchanger(
    emit: Callable[[int, bytes], None], cob_id: int, sample: Callable[[], bytes], rpdo: Rpdo
) -> Callable[[], None]:
    """Make `on_sync` of a node with one PDO each way at every SYNC, in virtual time."""

    def exchange() -> None:
        emit(cob_id, sample())
        data = rpdo.pending
        if data is not None:
            rpdo.pending = None
            rpdo.apply(data)

    return exchange
