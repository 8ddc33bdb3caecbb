from .cia301.object_dictionary import CSP_DCF_PATH, EDS_PATH
from .plant.simulate import simulate

__all__ = [
    "CSP_DCF_PATH",
    "EDS_PATH",
    "simulate",
]
