"""One run, from a recipe to its files.

`execution` (the whole of it): `checks` (whether it can begin), `compilation`, `session` (the
stage from boot to disabling, with `observers`), `record` (its files), `listener` (to whom it
reports), `run_history` (its estimates), `retries` (after a fault), `recorded` (from its files:
summary, page, list, where to resume), `replay` (a run again, on its bus log).

Its names, in `__init__.pyi`, are imported on first use: a dry run needs neither kernels nor HDF5.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
