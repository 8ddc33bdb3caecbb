"""Has a drive stop by itself when its host is lost.

0x1016 makes it watch our heartbeat, 0x6007 is its reaction. A drive without the former, or without
a reaction, stays under power with its last setpoint when the host dies or the cable breaks. Node
guarding (0x100C, 0x100D) is not used.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers import objects as od
from drivers.canopen import Node
from drivers.errors import RefusedError
from drivers.objects import ObjectRef
from drivers.settings import HOST_NODE

PERIOD_MS = 500
"""The drive considers its host lost after this time without a heartbeat."""
SHORTEST_MS, LONGEST_MS = 300, 1000
"""Times that an EDS may limit that to: three heartbeats of the host; a stop that is late enough."""
_COUNT = ObjectRef(0x1016, 0, "number of heartbeats watched")
_NO_ACTION = 0
_REACTIONS = {
    1: "it faults",
    2: "it switches the power off and the axis coasts, nothing brakes it",
    3: "it stops by a quick stop",
}
"""Values of 0x6007 when the host is lost (CiA 402)."""
_STAYS = "its host is lost, and stays under power"


def watch_host(
    node: Node, reaction: int, add_limitation: Callable[[str], object]
) -> tuple[ObjectRef, str] | None:
    """Has the drive watch the host's heartbeat and react to its loss.

    Args:
        node: of the drive.
        reaction: abort connection option code (0x6007), not 0.
        add_limitation: called with a clause where the drive reacts in another way.

    Returns:
        None, or why the drive keeps running without its host: the object and one clause.

    Raises:
        NodeError: the node does not answer.
    """
    period = _allowed(node)
    if not SHORTEST_MS <= period <= LONGEST_MS:
        why = f"allows {period} ms by its EDS, {PERIOD_MS} ms are needed"
        return od.HEARTBEAT_CONSUMER, f"{why}: the drive does not notice that {_STAYS}"
    if period != PERIOD_MS:
        add_limitation(
            f"{od.HEARTBEAT_CONSUMER} is {period} ms, not {PERIOD_MS} ms, by its EDS: so long the "
            "drive goes on without its host"
        )
    wanted = HOST_NODE << 16 | period
    held, why = _kept(node, od.HEARTBEAT_CONSUMER, wanted)
    if held == wanted and node.offers(_COUNT) and node.read(_COUNT) == 0:
        held, why = None, f"{_COUNT} is 0"
    if held != wanted:
        return od.HEARTBEAT_CONSUMER, f"{why}: the drive does not notice that {_STAYS}"
    held, why = _kept(node, od.ABORT_CONNECTION_OPTION, reaction)
    if held == _NO_ACTION:
        return od.ABORT_CONNECTION_OPTION, f"{why}: the drive does nothing when {_STAYS}"
    if held != reaction:
        done = _REACTIONS.get(-1 if held is None else held, "the reaction is manufacturer specific")
        add_limitation(f"{od.ABORT_CONNECTION_OPTION} {why}: without its host {done}")
    return None


def _allowed(node: Node) -> int:
    """The time nearest to `PERIOD_MS` that the EDS allows [ms].

    Limits are of the whole value, whose upper half is the node id, or of the time alone.
    """

    def time(limit: int | None, otherwise: int) -> int:
        if limit is None or limit >> 16 not in (0, HOST_NODE):
            return otherwise
        return limit & 0xFFFF

    low, high = node.limits(od.HEARTBEAT_CONSUMER)
    return min(max(PERIOD_MS, time(low, 0)), time(high or None, 0xFFFF))


def _kept(node: Node, obj: ObjectRef, value: int) -> tuple[int | None, str]:
    """What the object holds after `value` was written, and a clause on what is wrong with it."""
    try:
        kept = node.write_if_accepted(obj, value)
    except RefusedError as refused:
        return None, refused.cause
    if kept is None:
        return None, "is not offered"
    held, refusal = kept
    because = "" if refusal is None else f" ({refusal.cause})"
    return held, f"is {held}, not {value}{because}"
