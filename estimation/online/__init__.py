"""The split-horizon estimator: friction figures after every move, for the next one.

`estimator` is its interface. `update` takes one move, compiled (`solver`, then `judge`); `outcome`
and `estimate` hold the result, `belief` what is known between moves.
"""

from estimation.online.belief import (
    COULOMB,
    FIGURES,
    LEVEL,
    MASS,
    STIFFNESS,
    VISCOUS,
    Belief,
    BeliefSettings,
)
from estimation.online.estimate import Estimate
from estimation.online.estimator import Preview, SplitHorizonEstimator
from estimation.online.settings import EstimatorSettings
from estimation.online.solver.zones import REST, SLIDE, STICK, split

__all__ = [
    "COULOMB",
    "FIGURES",
    "LEVEL",
    "MASS",
    "REST",
    "SLIDE",
    "STICK",
    "STIFFNESS",
    "VISCOUS",
    "Belief",
    "BeliefSettings",
    "Estimate",
    "EstimatorSettings",
    "Preview",
    "SplitHorizonEstimator",
    "split",
]
