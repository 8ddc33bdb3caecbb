"""Process data of one axis as raw integers, and the account of its TPDOs from SYNC to SYNC.

The mappings are those of `drivers.drive.axis`: (controlword, target, force offset) out,
(statusword, position, force) in.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.canopen import OwnFrame
from drivers.drive import Axis, State, decode
from drivers.objects import TARGET_POSITION

_MAX_EXTRA = 255
_MAX_OUTSTANDING = 20
"""Missing TPDOs that may still arrive; older ones never will."""


class Channel:
    """Process data of one axis, as last sent and last received.

    Attributes:
        accepts_offset: whether the RPDO carries a force offset.
        controlword, target, offset: of the last RPDO, or of the next one outside streams. The
            target is a position, in csv a velocity, in cst a force.
        statusword, position, force: of the last sample; `seen` is False before the first.
        valid: whether the last SYNC brought a sample.  arrival: its time after the SYNC [ns],
            -1 without one.
        missed: consecutive SYNCs without a sample.
        sent_controlwords: the last four different ones, oldest first.
        extra: TPDOs besides the sample since the last SYNC.  previous_extra: of the SYNC before.
        doubled: consecutive SYNCs with more TPDOs than late ones account for.
        ambiguous: the last of these TPDOs differed. Which one is the axis' own is unknown, so there
            is no sample until a SYNC brings a single TPDO again.
        tpdo: CAN-ID and number of bytes of its TPDO.
        force_tpdo: the same of the TPDO that has the force alone; None: there is none.
        tardy: (statusword, position, force, arrival) of a TPDO that arrived after the host had
            stopped waiting but before the next SYNC, where frames have time stamps; else None.
        previous_tardy: the same of the SYNC before.
    """

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.sent_controlwords: deque[int] = deque(maxlen=4)
        self.use_mappings()
        self.controlword = self.target = self.offset = 0
        self.statusword = self.position = self.force = 0
        self.seen = self.valid = False
        self.arrival = -1
        self.missed = self.extra = self.previous_extra = self.doubled = 0
        self.ambiguous = self._differ = self._was_asked = False
        self._first: bytes | bytearray | None = None
        self._force: bytes | bytearray | None = None
        self._outstanding = 0
        self.tardy: tuple[int, int, int, int] | None = None
        self.previous_tardy: tuple[int, int, int, int] | None = None

    def use_mappings(self) -> None:
        """Takes over the axis' present mappings."""
        axis = self.axis
        self.rpdo_id = axis.rpdo_id
        self.message = OwnFrame(
            arbitration_id=axis.rpdo_id, is_extended_id=False, data=bytes(axis.rpdo.codec.size)
        )
        self.accepts_offset = axis.accepts_force_offset
        self._pack = axis.rpdo.codec.pack
        unpack = axis.tpdo.codec.unpack
        self.size = axis.tpdo.codec.size
        self.tpdo = axis.tpdo_id, self.size
        alone = axis.force_tpdo
        self.force_tpdo = None if alone is None else (axis.force_id, alone.codec.size)
        self._unpack_force = None if alone is None else alone.codec.unpack
        # without 0x6077 the force reads 0
        self.unpack: Callable[[bytes | bytearray], tuple[int, ...]] = (
            unpack if axis.reports_force and alone is None else lambda data: (*unpack(data), 0)
        )

    def reset(self) -> None:
        """Discards what was received so far: the axis is about to be configured again."""
        self.seen = self.valid = self.ambiguous = self._was_asked = False
        self.controlword = self.offset = 0
        self.sent_controlwords.clear()
        self.extra = self.doubled = self._outstanding = 0

    @property
    def state(self) -> State:
        """Power state of the last statusword."""
        return decode(self.statusword)

    # -- TPDOs, from one SYNC to the next -----------------------------------------------------

    def close_cycle(self) -> None:
        """Accounts for the TPDOs of the last SYNC; called at the next one.

        A drive answers each SYNC once, so a late TPDO was missing before. Only a TPDO that none was
        missing for is one too many.
        """
        if self.valid and not self.extra and not self.doubled:  # nearly always
            self.previous_extra = 0
            return
        surplus = self.extra + (self.valid or self.tardy is not None) - 1
        self.previous_extra, self.extra = self.extra, 0
        if surplus < 0 and self._was_asked:
            self.expect_more(1)
        late = min(max(surplus, 0), self._outstanding)
        self._outstanding -= late
        if surplus > late:
            self.doubled += 1
            self.ambiguous = self._differ
        else:
            self.doubled = 0
            self.ambiguous = False

    def open_cycle(self) -> None:
        """A SYNC was sent: one TPDO is due."""
        self.valid = self._differ = False
        self._first, self._was_asked = None, True
        self._force = None

    def take(self, data: bytes | bytearray, arrival: int) -> None:
        """Takes the first TPDO in the window, `arrival` after its SYNC [ns]."""
        self._first, self.arrival, self.valid = data, arrival, True

    def take_force(self, data: bytes | bytearray) -> bool:
        """Takes the TPDO of the force alone; False: there was one already."""
        if self._force is not None:
            return False
        self._force = data
        return True

    def take_extra(self, data: bytes | bytearray) -> None:
        """Counts a TPDO that is not the first, or is outside the window."""
        if self._first is not None and data != self._first:
            self._differ = True
        if self.extra < _MAX_EXTRA:
            self.extra += 1

    @property
    def is_answered(self) -> bool:
        """Whether a TPDO came within the window, even one that makes no sample."""
        return self._first is not None

    def conclude(self) -> bool:
        """Ends the wait for this SYNC's TPDO and decodes it; False where there is no sample.

        A TPDO contradicted by another one is no sample, unless the other one was merely late.
        """
        if self._first is not None and (
            self.ambiguous or (self._differ and self.extra > self._outstanding)
        ):
            self.valid = False
            self.take_extra(self._first)
        if self._unpack_force is not None and self._force is None:
            self.valid = False  # half a sample is none
        if self._first is None or not self.valid:
            self.arrival = -1
            self.missed += 1
            return False
        self.statusword, self.position, self.force = self.unpack(self._first)
        if self._unpack_force is not None and self._force is not None:
            (self.force,) = self._unpack_force(self._force)
        self.seen = True
        self.missed = 0
        return True

    def take_sole(self, data: bytes) -> bool:
        """A whole cycle in one, from `close_cycle` to `conclude`, where `data` is its only TPDO.

        Returns:
            Whether there is a sample.
        """
        if not self.valid or self.extra or self.doubled:
            self.close_cycle()
            self.open_cycle()
            self.take(data, 0)
            return self.conclude()
        self.previous_extra, self.arrival = 0, 0
        self._first, self._differ, self._was_asked = data, False, True
        self.statusword, self.position, self.force = self.unpack(data)
        return True

    def expect_more(self, count: int) -> None:
        """Allows for `count` more TPDOs: late ones, or answers to SYNCs outside the cycle."""
        self._outstanding = min(self._outstanding + count, _MAX_OUTSTANDING)

    # -- RPDO ---------------------------------------------------------------------------------

    def stand_still(self) -> None:
        """Sets the target that moves nothing: the actual position; 0 for velocity and force."""
        self.target = self.position if self.axis.target == TARGET_POSITION else 0
        self.offset = 0

    def pack(self) -> bytes:
        """The RPDO's data for the present controlword, target and offset."""
        word, sent = self.controlword, self.sent_controlwords
        if not sent or sent[-1] != word:
            sent.append(word)
        if self.accepts_offset:
            return self._pack(word, self.target, self.offset)
        self.offset = 0
        return self._pack(word, self.target)
