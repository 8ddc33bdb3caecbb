"""Runs a recipe on a stage.

`engine` (the steps of a plan), `mover` (one move), `streamer` (its setpoints), `compensation` (its
force offsets and what is learned), `samples` (what of it the estimator takes), `following_error`
(the host's watch), `settling` (how the moves went).

Its names, in `__init__.pyi`, are imported on first use: a dry run needs neither kernels nor HDF5.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
