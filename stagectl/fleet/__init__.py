"""Diagnoses of many recordings of many stages, on the processes of one machine or of a cluster.

`storage` finds recordings and keeps results, `task` is the work on one recording, `schedule` hands
it to workers, `ledger` knows what has been done, `history` adds friction from a database; `stages`
puts results together by stage, `common` and `drift` look for patterns, `summary` says it all.

Its names, in `__init__.pyi`, are imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
