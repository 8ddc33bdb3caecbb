from .all_axes import compile_kernels, make_compensation
from .axis_compensation import TAKE_OVER, AxisCompensation, Learned
from .known_axis import KnownAxis
from .mode import Figures, Mode
from .observed_offsets import ObservedOffsets
from .path_friction import PathFriction
from .places import Expectation, FreshPlaces, Places

__all__ = [
    "TAKE_OVER",
    "AxisCompensation",
    "Expectation",
    "Figures",
    "FreshPlaces",
    "KnownAxis",
    "Learned",
    "Mode",
    "ObservedOffsets",
    "PathFriction",
    "Places",
    "compile_kernels",
    "make_compensation",
]
