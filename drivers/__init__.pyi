from .errors import (
    AxisFault,
    BusError,
    ConfigurationError,
    DriverError,
    HomingError,
    LimitError,
    NodeError,
)
from .stage import Stage

__all__ = [
    "AxisFault",
    "BusError",
    "ConfigurationError",
    "DriverError",
    "HomingError",
    "LimitError",
    "NodeError",
    "Stage",
]
