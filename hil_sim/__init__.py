"""The virtual stage: simulated mechanics, CiA 402 drives and the bus they are on.

Its rooms offer their own names; here is what programs without a stage need: the drive's EDS and
DCF, and `simulate`, the plant without a bus. These names, in `__init__.pyi`, are imported on first
use, so that `import hil_sim.settings` loads neither numba nor CAN.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
