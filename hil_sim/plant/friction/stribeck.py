"""The Stribeck curve, which all friction laws of the simulated plant share.

Source: s(v) of docs/reference/reference-stage.md, the plant.
"""

from __future__ import annotations

import math

from stagedata.compiled import kernel


@kernel(inline="always")
def stribeck(velocity: float, static_ratio: float, stribeck_velocity: float, shape: float) -> float:
    """s(v) = 1 + alpha exp(-|v/vs|^delta): the Stribeck curve over the Coulomb level."""
    ratio = abs(velocity) / stribeck_velocity
    if shape != 1.0:
        ratio = ratio**shape
    return 1.0 + static_ratio * math.exp(-ratio)
