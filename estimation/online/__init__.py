"""The split-horizon estimator: friction figures after every move, for the next one.

`estimator` is its interface. `update` takes one move, compiled (`solver`, then `judge`); `outcome`
and `estimate` hold the result, `belief` what is known between moves.
"""

from estimation.online.belief import FIGURES, BeliefSettings
from estimation.online.estimate import Estimate
from estimation.online.estimator import SplitHorizonEstimator
from estimation.online.settings import EstimatorSettings

__all__ = ["FIGURES", "BeliefSettings", "Estimate", "EstimatorSettings", "SplitHorizonEstimator"]
