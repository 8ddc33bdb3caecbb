"""The data that the other packages exchange: samples, moves, recordings. No bus, no files.

What two packages share and neither owns lives here, as frozen dataclasses in SI units. Everything
may import this package; it imports none of the others.
"""

from stagedata.samples import Samples

__all__ = ["Samples"]
