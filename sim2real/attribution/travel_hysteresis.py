"""Whether the force that a model leaves in motion is a hysteresis over travel, of any shape.

Elements that go along and slide, each after its own travel, make any such hysteresis (Prandtl and
Ishlinskii); a cable in the library's shape is one of them. Those of presliding friction are
shorter by far.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.attribution.residual_force import stops, told
from sim2real.fitting import AxisModel
from sim2real.gap import Measured

F64 = NDArray[np.float64]

_WIDTHS = np.geomspace(1.5e-4, 2e-2, 8)
"""Travel from the middle until the elements slide [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class TravelHysteresis:
    """Hysteresis over travel.

    Attributes:
        share: of the force left in motion that it foretells (`sim2real.left_in_motion`).
        force: of all elements together [N]; below 0: it feeds motion, which no cable does.
        stiffness: of one element that would stand for all [N/m].
    """

    share: float
    force: float
    stiffness: float


def travel_hysteresis(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> TravelHysteresis:
    """Fit a hysteresis to what a model leaves; arguments as `left_in_motion.told`."""
    found = told(name, models, measured, settings, lambda x, _v, _step: stops(x, _WIDTHS))
    weights = np.maximum(found.weights, 0.0)
    width = float(np.exp(weights @ np.log(_WIDTHS) / max(float(weights.sum()), 1e-300)))
    force = float(found.weights.sum())
    return TravelHysteresis(found.share, force, force / width)
