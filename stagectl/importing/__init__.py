"""Data of other programs become recordings.

`import_map` reads which column is which channel, in which unit. `columns` are those of a file:
a trace of CODESYS, of `text_table` or `binary_table` (MATLAB, NumPy, HDF5, in `foreign_process`).
`recording` brings them into SI units, onto one clock.

Its names, in `__init__.pyi`, are imported on first use: the process of its own needs few of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
