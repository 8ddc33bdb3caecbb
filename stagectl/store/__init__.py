"""Files of a run: journal, recording, summary, bus log.

`journal` (during the run), `journal_reader` and `journal_to_recording`,
`recording` and `recording_blocks` (HDF5; `hdf5`, `ledger`), `bus_log` (`frame_spool`, `asc_log`)
and `log_reader`, `summary`, `atomic`. Beside a machine file: `axis_notes`.

Its names, in `__init__.pyi`, are imported on first use: a dry run needs neither kernels nor HDF5.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
