"""The split-horizon estimator: friction figures after every move, for the next one.

`estimator` is its interface. `update` takes one move, compiled (`solver`, then `judge`); `outcome`
and `estimate` hold the result, `belief` what is known between moves.
"""

from estimation.online.belief.belief import FIGURES as FIGURES
from estimation.online.belief.belief import BeliefSettings as BeliefSettings
from estimation.online.estimate import Estimate as Estimate
from estimation.online.estimator import SplitHorizonEstimator as SplitHorizonEstimator
from estimation.online.settings import EstimatorSettings as EstimatorSettings
