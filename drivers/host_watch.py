"""Whether a drive stops by itself when its host is gone: it has to notice that, and to act on it.

0x1016 lets it notice that our heartbeat stays away, 0x6007 says what it does then. A drive that
lacks the one, or does nothing by the other, goes on under power with its last set-point when the
host dies or the cable breaks. Node guarding (0x100C, 0x100D) is not used in place of the heartbeat.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers import objects as od
from drivers.errors import ConfigurationError, NodeError
from drivers.node import Node
from drivers.objects import ObjectRef
from drivers.settings import HOST_NODE

PERIOD_MS = 500
"""The drive misses its host after this time without a heartbeat."""
_COUNT = ObjectRef(0x1016, 0, "number of heartbeats watched")
_NO_ACTION = 0
_GONE = "its host is gone, and stays under power"


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
    problem = _refusal(node, od.HEARTBEAT_CONSUMER, HOST_NODE << 16 | PERIOD_MS)
    if problem is None and _held(node, _COUNT) == 0:
        problem = f"{_COUNT} is 0"
    if problem is not None:
        return od.HEARTBEAT_CONSUMER, f"{problem}: the drive does not notice that {_GONE}"
    problem = _refusal(node, od.ABORT_CONNECTION_OPTION, reaction)
    held = None if problem is None else _held(node, od.ABORT_CONNECTION_OPTION)
    if held == _NO_ACTION:
        return od.ABORT_CONNECTION_OPTION, f"{problem}: the drive does nothing when {_GONE}"
    if problem is not None and held != reaction:
        limited(
            f"{od.ABORT_CONNECTION_OPTION} {problem}: "
            "what the drive does when it loses its host is its own matter"
        )
    return None


def _refusal(node: Node, obj: ObjectRef, value: int) -> str | None:
    """Writes an object and reads it back; why the drive does not hold the value, None: it does."""
    if not node.offers(obj):
        return "is not offered"
    try:
        node.write_checked(obj, value)
    except NodeError as refused:
        if refused.abort_code is None:
            raise
        return refused.cause
    except ConfigurationError as other:
        return other.cause
    return None


def _held(node: Node, obj: ObjectRef) -> int | None:
    """The object's value, None where the node does not let it be read."""
    if not node.offers(obj):
        return None
    try:
        return node.read(obj)
    except NodeError as refused:
        if refused.abort_code is None:
            raise
        return None
