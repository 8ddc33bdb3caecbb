"""The cyclic path: setpoints out, SYNC, process data in; no SDO in here."""

from drivers.cyclic.channel import Channel
from drivers.cyclic.cycle import Cycle, Sink, Until
from drivers.cyclic.realtime import RealTime
from drivers.cyclic.samples import Sample, decode_rows

__all__ = [
    "Channel",
    "Cycle",
    "RealTime",
    "Sample",
    "Sink",
    "Until",
    "decode_rows",
]
