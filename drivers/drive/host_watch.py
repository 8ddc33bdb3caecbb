"""Whether a drive stops by itself when its host is gone: it has to notice that, and to act on it.

0x1016 lets it notice that our heartbeat stays away, 0x6007 says what it does then. A drive that
lacks the one, or does nothing by the other, goes on under power with its last set-point when the
host dies or the cable breaks. Node guarding (0x100C, 0x100D) is not used in place of the heartbeat.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers import objects as od
from drivers.canopen import Node
from drivers.errors import NodeError
from drivers.objects import ObjectRef
from drivers.settings import HOST_NODE

PERIOD_MS = 500
"""The drive misses its host after this time without a heartbeat."""
_COUNT = ObjectRef(0x1016, 0, "number of heartbeats watched")
_NO_ACTION = 0
_REACTIONS = {
    1: "it faults",
    2: "it switches the power off and the axis coasts, nothing brakes it",
    3: "it stops by a quick stop",
}
"""What 0x6007 has a drive do when its host is gone (CiA 402)."""
_STAYS = "its host is gone, and stays under power"


def unwatched(
    node: Node, reaction: int, limited: Callable[[str], object]
) -> tuple[ObjectRef, str] | None:
    """Has the drive watch the host's heartbeat and do `reaction` (0x6007) when it stays away.

    Args:
        node: of the drive.
        reaction: abort connection option code, not 0.
        limited: called with a clause where the drive does something else than `reaction`.

    Returns:
        Why the drive goes on without its host: the object, and one clause; None: it does not.

    Raises:
        NodeError: the node does not answer.
    """
    wanted = HOST_NODE << 16 | PERIOD_MS
    held, why = _kept(node, od.HEARTBEAT_CONSUMER, wanted)
    if held == wanted and node.offers(_COUNT) and node.read(_COUNT) == 0:
        held, why = None, f"{_COUNT} is 0"
    if held != wanted:
        return od.HEARTBEAT_CONSUMER, f"{why}: the drive does not notice that {_STAYS}"
    held, why = _kept(node, od.ABORT_CONNECTION_OPTION, reaction)
    if held == _NO_ACTION:
        return od.ABORT_CONNECTION_OPTION, f"{why}: the drive does nothing when {_STAYS}"
    if held != reaction:
        done = _REACTIONS.get(
            -1 if held is None else held, "the drive does what its maker has it do"
        )
        limited(f"{od.ABORT_CONNECTION_OPTION} {why}: without its host {done}")
    return None


def _kept(node: Node, obj: ObjectRef, value: int) -> tuple[int | None, str]:
    """What the object holds after `value` was asked for, and what is wrong with that."""
    try:
        kept = node.keep(obj, value)
    except NodeError as refused:
        if refused.abort_code is None:
            raise
        return None, refused.cause
    if kept is None:
        return None, "is not offered"
    held, refusal = kept
    because = "" if refusal is None else f" ({refusal.cause})"
    return held, f"is {held}, not {value}{because}"
