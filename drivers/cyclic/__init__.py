"""The cyclic path: setpoints out, SYNC, process data in. No SDO in here."""

from drivers.cyclic.channel import Channel
from drivers.cyclic.correction import OffsetCorrection
from drivers.cyclic.cycle import Cycle, Until
from drivers.cyclic.realtime import RealTime
from drivers.cyclic.samples import Sink, decode_rows

__all__ = ["Channel", "Cycle", "OffsetCorrection", "RealTime", "Sink", "Until", "decode_rows"]
