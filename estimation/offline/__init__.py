"""Friction figures that single moves do not determine, from many of them; not time-critical.

Stribeck curve, shape of the hysteresis and asymmetry: recorded positions and forces in, figures
with sigma and verdict out. `identify` is the entry; `model` the compiled friction model; `unknowns`
what is estimated, with its prior; `records` the samples; `fit` the least squares; `held_out` what
moves that were left out say of the estimates.
"""

from estimation.offline.held_out import BETTER, NO_BETTER, UNTESTED, WORSE
from estimation.offline.identify import (
    BOUND,
    ESTIMATED,
    PRIOR,
    Figure,
    Identification,
    OfflineSettings,
    identify,
)
from estimation.offline.records import Samples, joined

__all__ = [
    "BETTER",
    "BOUND",
    "ESTIMATED",
    "NO_BETTER",
    "PRIOR",
    "UNTESTED",
    "WORSE",
    "Figure",
    "Identification",
    "OfflineSettings",
    "Samples",
    "identify",
    "joined",
]
