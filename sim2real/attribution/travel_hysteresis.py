"""Whether the residual force in motion is a hysteresis over travel, of any shape.

Stop operators of different widths add up to any such hysteresis (Prandtl-Ishlinskii); a cable in
the library's shape is one of them. Those of presliding friction are much narrower.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.attribution.residual_force import explain_residual_force, stop_operators
from sim2real.fitting import AxisModel
from sim2real.gap import Measured

F64 = NDArray[np.float64]

_WIDTHS = np.geomspace(1.5e-4, 2e-2, 8)
"""Travel from the middle until the elements slide [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class TravelHysteresis:
    """Hysteresis over travel.

    Attributes:
        share: of the residual force in motion that it predicts
            (`sim2real.attribution.residual_force`).
        force: of all elements together [N]; below 0 it drives motion, which no cable does.
        stiffness: of the equivalent single element [N/m].
    """

    share: float
    force: float
    stiffness: float


def fit_travel_hysteresis(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> TravelHysteresis:
    """Fit a hysteresis to what a model leaves; arguments as `explain_residual_force`."""
    found = explain_residual_force(
        name, models, measured, settings, lambda x, _v, _step: stop_operators(x, _WIDTHS)
    )
    weights = np.maximum(found.weights, 0.0)
    width = float(np.exp(weights @ np.log(_WIDTHS) / max(float(weights.sum()), 1e-300)))
    force = float(found.weights.sum())
    return TravelHysteresis(found.share, force, force / width)
