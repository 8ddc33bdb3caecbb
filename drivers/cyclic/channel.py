"""What is cyclic of one axis: its process data as raw integers, and the frames that carry them.

Mappings are those of `axis.py`: (controlword, target, offset) and (statusword, position, force).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.canopen import OwnFrame
from drivers.drive import Axis
from drivers.objects import TARGET_POSITION

_MOST_EXTRA = 255
_MOST_OWED = 20
"""TPDOs that have stayed away and may still come: older ones never will."""


class Channel:
    """Cyclic state of one axis: raw integers, as last sent and last received.

    Attributes:
        controlword, target, offset: of the next RPDO (outside streams) or the last one; the target
            is a position, in csv a velocity, in cst a force.
        statusword, position, force: of the last TPDO; `seen` is False before the first.
        valid: whether the last cycle brought a sample.  arrival: of it, after the SYNC [ns].
        missed: SYNCs in a row without a sample.  told: last controlwords, each once, oldest first.
        extra: TPDOs that came besides since the last SYNC.  before: those of the SYNC before.
        doubled: SYNCs in a row that brought more TPDOs than one, which no late one accounts for.
        contested: whether those of the last such SYNC differed: which one is the axis' own is not
            known, so none counts until a SYNC brings one again.
        tardy: (statusword, position, force, arrival) of a TPDO that came after we went on without
            it, but before the next SYNC; where frames carry their time. None where there was none.
        previous: the same of the SYNC before.
    """

    __slots__ = (
        "_asked", "_differ", "_first", "_owed", "arrival", "axis", "before", "contested",
        "controlword", "doubled", "extra", "force", "missed", "offset", "position", "previous",
        "rpdo", "seen", "size", "statusword", "tardy", "target", "told", "unpack", "valid",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.told: deque[int] = deque(maxlen=4)
        self.adapt()
        self.controlword = self.target = self.offset = 0
        self.statusword = self.position = self.force = 0
        self.seen = self.valid = False
        self.arrival = -1
        self.missed = self.extra = self.before = self.doubled = 0
        self.contested = self._differ = self._asked = False
        self._first: bytes | bytearray | None = None
        self._owed = 0
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

    def forget(self) -> None:
        """What came so far says nothing any more: the axis is set up anew."""
        self.seen = self.valid = self.contested = self._asked = False
        self.controlword = self.offset = 0
        self.told.clear()
        self.doubled = self._owed = 0

    # -- its TPDOs from one SYNC to the next --------------------------------------------------

    def expect(self) -> None:
        """A SYNC has been: one TPDO is to come."""
        self.valid = self._differ = False
        self._first, self._asked = None, True

    def take(self, data: bytes | bytearray, arrival: int) -> None:
        """The first TPDO in the window, `arrival` after its SYNC [ns]."""
        self._first, self.arrival, self.valid = data, arrival, True

    def besides(self, data: bytes | bytearray) -> None:
        """A TPDO that is not the first, or outside the window."""
        if self._first is not None and data != self._first:
            self._differ = True
        if self.extra < _MOST_EXTRA:
            self.extra += 1

    @property
    def answered(self) -> bool:
        """Whether a TPDO came in the window, be there a sample or not."""
        return self._first is not None

    def conclude(self) -> bool:
        """Nothing more is waited for; whether there is a sample.

        One that another contradicts is none, unless that one is only late.
        """
        if self._first is not None and (
            self.contested or (self._differ and self.extra > self._owed)
        ):
            self.valid = False
            self.besides(self._first)
        if self._first is None or not self.valid:
            self.arrival = -1
            self.missed += 1
            return False
        self.statusword, self.position, self.force = self.unpack(self._first)
        self.seen = True
        self.missed = 0
        return True

    def owe(self, count: int) -> None:
        """So many TPDOs more are to come: answers to SYNCs besides, or late ones."""
        self._owed = min(self._owed + count, _MOST_OWED)

    def turn(self) -> None:
        """The next SYNC: what has come for the last one is counted.

        A drive answers each SYNC once: TPDOs that came late are missing before. Only what nothing
        was missing for is one too many.
        """
        if self.valid and not self.extra and not self.doubled:  # as nearly always
            self.before = 0
            return
        many = self.extra + (self.valid or self.tardy is not None) - 1
        self.before, self.extra = self.extra, 0
        if many < 0 and self._asked:
            self.owe(1)
        late = min(max(many, 0), self._owed)
        self._owed -= late
        if many > late:
            self.doubled += 1
            self.contested = self._differ
        else:
            self.doubled = 0
            self.contested = False

    # -- its RPDO -----------------------------------------------------------------------------

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
