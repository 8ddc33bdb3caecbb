"""One run, from a recipe to its files.

`execution` (the whole of it): `checks` (whether it can begin), `compilation`, `prepare`, `session`
(the stage from boot to disabling, with `observers`), `record` (its files), `listener` (to whom it
reports), `run_history` (its estimates), `summarise` and `documents` (from the recording), `retries`
(after a fault), `resume` (an interrupted run), `listing`, `replay` (a run again, on its bus log).

Its names, in `__init__.pyi`, are imported on first use: a dry run needs neither kernels nor HDF5.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
