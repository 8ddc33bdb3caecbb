"""NMT slave of the virtual drive: boot-up, commands, heartbeat produced and consumed (CiA 301).

A heartbeat consumer (0x1016) starts with the first heartbeat it receives. Node guarding and LSS are
not supported.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import partial

from canopen.sdo import constants as abort

from hil_sim.cia301.object_dictionary import Dictionary, key, require
from hil_sim.ports import CanSegment, Timer

BOOT_NS = 20_000_000  # from power-on or reset to the boot-up message

_PRODUCER = key(0x1017)
_CONSUMERS = range(key(0x1016, 1), key(0x1016, 5))


class NmtState(IntEnum):
    """NMT states, with their value in the heartbeat."""

    BOOTING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


_COMMANDS = {1: NmtState.OPERATIONAL, 2: NmtState.STOPPED, 128: NmtState.PRE_OPERATIONAL}
_RESET_NODE, _RESET_COMMUNICATION = 129, 130


def _consumer(value: int) -> tuple[int, int]:
    """Node and period [ms] of an entry of 0x1016; node 0: not used."""
    node = value >> 16 & 0xFF
    return node if node <= 127 else 0, value & 0xFFFF


class NmtSlave:
    """NMT state of a node.

    Args:
        on_state: called with (new, old) after each change of state.
        on_reset: called before a reset, with True for the application, False for communication.
        on_heartbeat: called with (node, alive) when a consumed heartbeat is lost or comes back.
    """

    def __init__(
        self,
        node_id: int,
        dictionary: Dictionary,
        segment: CanSegment,
        on_state: Callable[[NmtState, NmtState], None],
        on_reset: Callable[[bool], None],
        on_heartbeat: Callable[[int, bool], None],
    ) -> None:
        self.state = NmtState.BOOTING
        self._node_id = node_id
        self._dictionary = dictionary
        self._segment = segment
        self._on_state = on_state
        self._on_reset = on_reset
        self._on_heartbeat = on_heartbeat
        self._producer: Timer | None = None
        self._consumers: list[_Consumer] = []
        dictionary.on_write[_PRODUCER] = lambda _: self._start_producer()
        for k in _CONSUMERS:
            dictionary.check[k] = partial(self._check_consumer, k)
            dictionary.on_write[k] = lambda _: self._start_consumers()

    def power_on(self) -> None:
        """Boot; the node neither receives nor sends before its boot-up message."""
        self._segment.at(self._segment.now_ns + BOOT_NS, self._boot_up)

    def enter(self, state: NmtState) -> None:
        """Change to this state."""
        old, self.state = self.state, state
        if old is not state:
            self._on_state(state, old)

    def _boot_up(self) -> None:
        self._segment.subscribe(0x000, self._on_command)
        self._segment.emit(0x700 + self._node_id, b"\x00")
        self.enter(NmtState.PRE_OPERATIONAL)
        self._start_producer()
        self._start_consumers()

    def _on_command(self, data: bytes) -> None:
        if len(data) < 2 or data[1] not in (0, self._node_id):
            return
        state = _COMMANDS.get(data[0])
        if state is not None:
            self.enter(state)
        elif data[0] in (_RESET_NODE, _RESET_COMMUNICATION):
            self._segment.unsubscribe(0x000, self._on_command)
            self._on_reset(data[0] == _RESET_NODE)
            self.enter(NmtState.BOOTING)
            self._stop_producer()
            self._stop_consumers()
            self.power_on()

    def _stop_producer(self) -> None:
        if self._producer is not None:
            self._producer.cancel()
            self._producer = None

    def _stop_consumers(self) -> None:
        for consumer in self._consumers:
            consumer.stop()
        self._consumers = []

    def _start_producer(self) -> None:
        self._stop_producer()
        if self._dictionary.integer(_PRODUCER):
            self._beat(self._segment.now_ns)

    def _beat(self, due_ns: int) -> None:
        self._segment.emit(0x700 + self._node_id, bytes((self.state,)))
        due_ns += self._dictionary.integer(_PRODUCER) * 1_000_000
        self._producer = self._segment.at(due_ns, lambda: self._beat(due_ns))

    def _start_consumers(self) -> None:
        self._stop_consumers()
        for k in _CONSUMERS:
            value = self._dictionary.integer(k)
            node, period_ms = _consumer(value)
            if node and period_ms:
                self._consumers.append(
                    _Consumer(self._segment, node, period_ms * 1_000_000, self._on_heartbeat)
                )

    def _check_consumer(self, k: int, value: int) -> None:
        require(not value >> 24)
        node, period_ms = _consumer(value)
        others = (_consumer(self._dictionary.integer(o)) for o in _CONSUMERS if o != k)
        doubled = period_ms and node and any(n == node and ms for n, ms in others)
        require(not doubled, abort.ABORT_PARAMETER_INCOMPATIBLE)


class _Consumer:
    """Consumes the heartbeat of one producer."""

    def __init__(
        self,
        segment: CanSegment,
        node: int,
        period_ns: int,
        on_change: Callable[[int, bool], None],
    ) -> None:
        self._segment = segment
        self._node = node
        self._period_ns = period_ns
        self._on_change = on_change
        self._deadline_ns = 0
        self._timer: Timer | None = None
        self._lost = False
        segment.subscribe(0x700 + node, self._on_heartbeat)

    def stop(self) -> None:
        self._segment.unsubscribe(0x700 + self._node, self._on_heartbeat)
        if self._timer is not None:
            self._timer.cancel()

    def _on_heartbeat(self, data: bytes) -> None:
        self._deadline_ns = self._segment.now_ns + self._period_ns
        if self._timer is None:
            self._timer = self._segment.at(self._deadline_ns, self._on_timer)
        if self._lost:
            self._lost = False
            self._on_change(self._node, True)

    def _on_timer(self) -> None:
        if self._segment.now_ns < self._deadline_ns:  # a heartbeat came meanwhile
            self._timer = self._segment.at(self._deadline_ns, self._on_timer)
            return
        self._timer = None
        self._lost = True
        self._on_change(self._node, False)
