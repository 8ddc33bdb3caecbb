"""The friction history: every estimate with time and place, in SQLite or PostgreSQL.

`records` (rows), `opening` (which history), `sql` on `database` or `postgres`, `writer` (a
thread), `filing` (from recordings), `measured` (levels).

Its names, in `__init__.pyi`, are imported on first use: a dry run needs neither kernels nor HDF5.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
