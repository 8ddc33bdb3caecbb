"""All process data of a node: four RPDOs and four TPDOs, what a SYNC does with them, and when.

They exist while the node is OPERATIONAL. `pdo.py` says what is offered and what is not.
"""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.cia301.dictionary import Dictionary, key
from hil_sim.cia301.pdo import EVENT, Hooks, Rpdo, Tpdo, in_order
from hil_sim.ports import CanSegment

COUNT = 4  # of each kind
_SYNC_WINDOW = key(0x1007)


class PdoEngine:
    """All PDOs of a node.

    Args:
        emergency: called with an EMCY code when an RPDO has the wrong length.
        stayed_away: called when an RPDO has not come again within its event timer.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        segment: CanSegment,
        emergency: Callable[[int], None],
        stayed_away: Callable[[], None],
    ) -> None:
        self._emergency = emergency
        self._stayed_away = stayed_away
        self._dictionary = dictionary
        self._segment = segment
        self._late_bus = hasattr(segment, "sync_overtaken")  # one in real time
        self._running = False
        self._sync_ns = 0
        self._window_ns = 0
        self._subscribed: list[tuple[int, Rpdo]] = []
        self._rpdos = [Rpdo(dictionary, n, self, segment) for n in range(COUNT)]
        self._tpdos = [Tpdo(dictionary, n, segment) for n in range(COUNT)]
        self._sync_rpdos: tuple[Rpdo, ...] = ()
        self._several = False
        self._emit = segment.emit
        self._at_every_sync: tuple[tuple[int, Callable[[], bytes]], ...] = ()
        self._sync_tpdos: tuple[Tpdo, ...] = ()
        self._event_tpdos: tuple[Tpdo, ...] = ()
        dictionary.on_write[_SYNC_WINDOW] = lambda _: self._arrange()
        for pdo in (*self._rpdos, *self._tpdos):
            keys = [pdo.cob_key, pdo.type_key]
            if isinstance(pdo, Rpdo):
                keys.append(pdo.deadline_key)
            for k in keys:
                dictionary.on_write[k] = lambda _, pdo=pdo: self._changed(pdo)  # type: ignore[misc]

    def start(self) -> None:
        """The node became operational: PDOs exist from now on."""
        self._running = True
        for pdo in (*self._rpdos, *self._tpdos):
            pdo.compile()
        self._arrange()
        for tpdo in self._event_tpdos:
            tpdo.start()

    def stop(self) -> None:
        """The node left operational: nothing is received or sent, nothing kept."""
        self._running = False
        for tpdo in self._tpdos:
            tpdo.stop()
        for rpdo in self._rpdos:
            rpdo.stop()
        self._arrange()

    def on_sync(self) -> None:
        """Send the synchronous TPDOs that are due; call `latch` afterwards."""
        # Overtaken, the host would take them for those of the SYNC that has come meanwhile.
        if not (self._late_bus and self._segment.sync_overtaken):  # type: ignore[attr-defined]
            for cob_id, sample in self._at_every_sync:
                self._emit(cob_id, sample())
            for tpdo in self._sync_tpdos:
                tpdo.on_sync()

    def latch(self) -> None:
        """Let the synchronous RPDOs received since the last SYNC act."""
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
        """Store what all of them bring before any of it acts."""
        hooks: Hooks = ()
        for rpdo in self._sync_rpdos:
            data = rpdo.pending
            if data is not None:
                rpdo.pending = None
                hooks += rpdo.store(data)
        values = self._dictionary.values
        for k, hook in in_order(hooks, self._dictionary.act_last) if len(hooks) > 1 else hooks:
            hook(values[k])  # type: ignore[arg-type]

    def emergency(self, code: int) -> None:
        """An EMCY for something that passes by itself."""
        self._emergency(code)

    def stayed_away(self) -> None:
        """An RPDO has not come again in time."""
        self._stayed_away()

    def on_event(self) -> None:
        """Statusword or mode display changed."""
        for tpdo in self._event_tpdos:
            tpdo.on_event()

    def in_window(self) -> bool:
        """Whether a synchronous RPDO arriving now counts (0x1007)."""
        return self._segment.now_ns - self._sync_ns <= self._window_ns

    def _changed(self, pdo: Rpdo | Tpdo) -> None:
        if not self._running:
            return
        pdo.compile()
        self._arrange()
        if isinstance(pdo, Tpdo):
            pdo.start()

    def _arrange(self) -> None:
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
        # the usual case without a call more per PDO; mixed ones keep their order
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
