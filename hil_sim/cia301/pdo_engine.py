"""All process data of a node: four RPDOs and four TPDOs, and what a SYNC does with them.

PDOs exist while the node is OPERATIONAL; `pdo` says what is supported.

Source: CiA 301, PDO and SYNC: 0x1400 to 0x1403, 0x1800 to 0x1803, and their mappings.
"""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.cia301.object_dictionary import Dictionary, key
from hil_sim.cia301.pdo import EVENT
from hil_sim.cia301.rpdo import Hooks, Rpdo, order_hooks
from hil_sim.cia301.tpdo import Tpdo
from hil_sim.ports import CanSegment

COUNT = 4  # of each kind
_SYNC_WINDOW = key(0x1007)


class PdoEngine:
    """All PDOs of a node.

    Args:
        dictionary: of the drive.
        segment: the bus.
        announce: sends the EMCY for an RPDO of the wrong length.
        on_timeout: called when an RPDO was not received within its event timer.

    Attributes:
        on_sync: sends the synchronous TPDOs that are due, then acts on the synchronous RPDOs
            received since the last SYNC.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        segment: CanSegment,
        announce: Callable[[int], None],
        on_timeout: Callable[[], None],
    ) -> None:
        self._dictionary = dictionary
        self._segment = segment
        self._running = False
        self._sync_ns = 0
        self._window_ns = 0
        self._subscribed: list[tuple[int, Rpdo]] = []
        self._rpdos = [
            Rpdo(dictionary, n, segment, self._act, self._is_in_window, announce, on_timeout)
            for n in range(COUNT)
        ]
        self._tpdos = [Tpdo(dictionary, n, segment) for n in range(COUNT)]
        self._sync_rpdos: tuple[Rpdo, ...] = ()
        self._sync_tpdos: tuple[Tpdo, ...] = ()
        self._event_tpdos: tuple[Tpdo, ...] = ()
        self.on_sync: Callable[[], None] = self._on_any_sync
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
        # The host would take them for the answer to the next SYNC, which is on the bus already.
        if not getattr(self._segment, "sync_overtaken", False):
            for tpdo in self._sync_tpdos:
                tpdo.on_sync()
        self.latch()

    def latch(self) -> None:
        """Act on the synchronous RPDOs received since the last SYNC."""
        hooks: Hooks = ()
        for rpdo in self._sync_rpdos:
            if rpdo.pending is not None:
                hooks += rpdo.store(rpdo.pending)
                rpdo.pending = None
        if hooks:
            self._act(hooks)
        self._sync_ns = self._segment.now_ns

    def _act(self, hooks: Hooks) -> None:
        """Act on what has been stored, once per object and in order."""
        values = self._dictionary.values
        for k, hook in order_hooks(hooks, self._dictionary.act_last) if len(hooks) > 1 else hooks:
            hook(values[k])  # type: ignore[arg-type]

    def on_event(self) -> None:
        """Statusword or mode display has changed."""
        for tpdo in self._event_tpdos:
            tpdo.on_event()

    def _is_in_window(self) -> bool:
        """Whether a synchronous RPDO received now counts (0x1007)."""
        return not self._window_ns or self._segment.now_ns - self._sync_ns <= self._window_ns

    def _changed(self, pdo: Rpdo | Tpdo) -> None:
        if not self._running:
            return
        pdo.compile()
        self._select_active()
        if isinstance(pdo, Tpdo):
            pdo.start()

    def _select_active(self) -> None:
        segment = self._segment
        for cob_id, rpdo in self._subscribed:
            segment.unsubscribe(cob_id, rpdo.on_frame)
        live = self._running
        self._window_ns = self._dictionary.integer(_SYNC_WINDOW) * 1000
        self._subscribed = [(r.cob_id, r) for r in self._rpdos if live and r.valid]
        for cob_id, rpdo in self._subscribed:
            segment.subscribe(cob_id, rpdo.on_frame)
        self._sync_tpdos = tuple(
            p for p in self._tpdos if live and p.valid and p.transmission <= 240
        )
        self._event_tpdos = tuple(
            p for p in self._tpdos if live and p.valid and p.transmission in EVENT
        )
        self._sync_rpdos = tuple(
            r for r in self._rpdos if live and r.valid and r.transmission <= 240
        )
        self.on_sync = self._on_any_sync
        if len(self._sync_tpdos) == len(self._sync_rpdos) == 1 and not self._window_ns:
            if self._sync_tpdos[0].transmission == 1 and not hasattr(segment, "sync_overtaken"):
                self.on_sync = _exchanger(segment.emit, self._sync_tpdos[0], self._sync_rpdos[0])


def _exchanger(emit: Callable[[int, bytes], None], tpdo: Tpdo, rpdo: Rpdo) -> Callable[[], None]:
    """Make `on_sync` of a node with one PDO each way at every SYNC, in virtual time."""
    cob_id, sample = tpdo.cob_id, tpdo.sample

    def exchange() -> None:
        emit(cob_id, sample())
        data = rpdo.pending
        if data is not None:
            rpdo.pending = None
            rpdo.apply(data)

    return exchange
