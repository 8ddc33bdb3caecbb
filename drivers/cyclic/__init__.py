"""The cyclic path: setpoints out, SYNC, process data in. No SDO in here."""

from drivers.cyclic.channel import Channel as Channel
from drivers.cyclic.cycle import Cycle as Cycle
from drivers.cyclic.cycle import Until as Until
from drivers.cyclic.realtime import RealTime as RealTime
from drivers.cyclic.rows import CorrectedOffsets as CorrectedOffsets
from drivers.cyclic.rows import OffsetCorrection as OffsetCorrection
from drivers.cyclic.samples import Sample as Sample
from drivers.cyclic.samples import Sink as Sink
from drivers.cyclic.samples import decode_rows as decode_rows
