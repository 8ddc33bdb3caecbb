"""What is cyclic of one axis: its process data as raw integers, and the frames that carry them.

Mappings are those of `axis.py`: (controlword, target, offset) and (statusword, position, force).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.axis import Axis
from drivers.bus import OwnFrame
from drivers.objects import TARGET_POSITION


class Channel:
    """Cyclic state of one axis: raw integers, as last sent and last received.

    Attributes:
        controlword, target, offset: of the next RPDO (outside streams) or the last one; the target
            is a position, in csv a velocity, in cst a force.
        statusword, position, force: of the last TPDO; `seen` is False before the first.
        valid: whether the last cycle brought a TPDO.  arrival: its time after the SYNC [ns].
        missed: TPDOs missed in a row.  told: last controlwords, each once, oldest first.
        extra: TPDOs that came besides since the last SYNC.  before: those of the SYNC before.
        tardy: (statusword, position, force, arrival) of a TPDO that came after we went on without
            it, but before the next SYNC; where frames carry their time. None where there was none.
        previous: the same of the SYNC before.
    """

    __slots__ = (
        "arrival", "axis", "before", "controlword", "extra", "force", "missed", "offset",
        "position", "previous", "rpdo", "seen", "size", "statusword", "tardy", "target", "told",
        "unpack", "valid",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.told: deque[int] = deque(maxlen=4)
        self.adapt()
        self.controlword = self.target = self.offset = 0
        self.statusword = self.position = self.force = 0
        self.seen = self.valid = False
        self.arrival = -1
        self.missed = self.extra = self.before = 0
        self.tardy: tuple[int, int, int, int] | None = None
        self.previous: tuple[int, int, int, int] | None = None

    def adapt(self) -> None:
        """Takes over the axis' mappings."""
        axis = self.axis
        self.rpdo = OwnFrame(
            arbitration_id=axis.rpdo_id, is_extended_id=False, data=bytes(axis.rpdo.codec.size)
        )
        unpack = axis.tpdo.codec.unpack
        self.size = axis.tpdo.codec.size
        # a drive that tells no force: it reads 0
        self.unpack: Callable[[bytes | bytearray], tuple[int, ...]] = (
            unpack if axis.tells_force else lambda data: (*unpack(data), 0)
        )

    def rest(self) -> None:
        """The target that moves nothing: where the axis is; 0 where the target is no position."""
        self.target = self.position if self.axis.target == TARGET_POSITION else 0
        self.offset = 0

    def frame(self) -> bytes:
        """The RPDO of the present command."""
        word = self.controlword
        if not self.told or self.told[-1] != word:
            self.told.append(word)
        if self.axis.takes_force_offset:
            return self.axis.rpdo.codec.pack(word, self.target, self.offset)
        self.offset = 0
        return self.axis.rpdo.codec.pack(word, self.target)
