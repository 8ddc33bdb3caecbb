"""Data of other programs become recordings.

`import_map` reads which column is which channel, in which unit. `columns` are those of a file:
`text_table`, `binary_table` (MATLAB, NumPy, HDF5) or `plc_trace` (CODESYS). `recording` brings them
into SI units, onto one clock.
"""

from stagectl.importing.import_map import ImportMap, load_map, unlike_rotary
from stagectl.importing.recording import import_recording

__all__ = ["ImportMap", "import_recording", "load_map", "unlike_rotary"]
