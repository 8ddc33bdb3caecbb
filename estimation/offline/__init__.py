"""Friction figures that no single move determines, fitted to many moves; not time-critical.

Stribeck curve, shape of the hysteresis and asymmetry: recorded positions and forces in, figures
with sigma and verdict out. `identify` is the entry; `records` prepares the samples; `unknowns` has
what is estimated, with its prior; `model` is the compiled friction model, `linearise` the residual
with its Jacobian, `whiten` its sums under correlated noise, `fit` the descent; `uncertainty` has
sigma and verdict of each figure, and `held_out` compares estimates with their priors on moves that
were left out.
"""

from estimation.offline.identify import Figure as Figure
from estimation.offline.identify import Identification as Identification
from estimation.offline.identify import identify as identify
from estimation.offline.records import OfflineSettings as OfflineSettings
from estimation.offline.records import Samples as Samples
