"""Force offsets of a move: `axis_compensation` makes them and learns from what came back.

`all_axes` makes that of every axis of a machine, `mode` says what they consist of; `places` is the
friction over the table, `known_axis` what the machine file's effects add,
`path_friction` both along the move under way, `acceleration_force` what accelerates and what moves
show of it, `observed_offsets` the correction from SYNC to SYNC.

Its names, in `__init__.pyi`, are imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
