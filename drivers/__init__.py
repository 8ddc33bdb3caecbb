"""The CAN side of the stage: CANopen nodes, CiA 402 axes, cyclic streaming. SI units in and out.

Applications use `Stage`; everything else serves it. Names are imported on first use, so that
`import drivers` loads neither can, canopen nor numpy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drivers.canopen import Clock, MonotonicClock
    from drivers.cyclic import Sample
    from drivers.errors import (
        AxisFault,
        BusError,
        ConfigurationError,
        DriverError,
        HomingError,
        LimitError,
        NodeError,
    )
    from drivers.settings import AxisSettings, BusSettings
    from drivers.stage import Stage

__all__ = [
    "AxisFault",
    "AxisSettings",
    "BusError",
    "BusSettings",
    "Clock",
    "ConfigurationError",
    "DriverError",
    "HomingError",
    "LimitError",
    "MonotonicClock",
    "NodeError",
    "Sample",
    "Stage",
]

_HOMES = {
    **dict.fromkeys(("Clock", "MonotonicClock"), "canopen.clock"),
    "Sample": "cyclic.samples",
    **dict.fromkeys(("AxisSettings", "BusSettings"), "settings"),
    "Stage": "stage",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'drivers' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"drivers.{_HOMES.get(name, 'errors')}"), name)
