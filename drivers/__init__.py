"""The CAN side of the stage: CANopen nodes, CiA 402 axes, cyclic streaming. SI units in and out.

Applications use `Stage` and catch its errors; everything else serves it. These names, in
`__init__.pyi`, are imported on first use, so that `import drivers` loads neither can, canopen nor
numpy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
