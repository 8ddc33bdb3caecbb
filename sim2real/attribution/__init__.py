"""Which effects explain the gap of an axis.

`search` selects effects one at a time. `parameter_scan` finds where to start fitting each, over the
nodes of `parameter_grid`, with first-order `signature`s; `alternatives` scores the sets of effects
fitted, `refinement` fits close ones to convergence, and `similarity` compares their signatures.
`shape_check`, `free_form`, `friction_profile` and `travel_hysteresis` (both on `residual_force`)
recognise an effect of the right family in another shape. `closed_loop_check` drops what does not
reduce the free-run gap, and `causes` puts probabilities and sigmas to what remains.
"""

from sim2real.attribution.alternatives import sets_of
from sim2real.attribution.causes import candidates_of, causes_of
from sim2real.attribution.closed_loop_check import gate
from sim2real.attribution.free_form import FreeForm, FrictionOverPosition, InMotion
from sim2real.attribution.friction_profile import friction_profile
from sim2real.attribution.parameter_scan import Scanner
from sim2real.attribution.search import AxisSearch, beside, search
from sim2real.attribution.shape_check import in_free_form, is_one_profile, nearest, repeats
from sim2real.attribution.similarity import Pairs, likeness
from sim2real.attribution.travel_hysteresis import travel_hysteresis

__all__ = [
    "AxisSearch",
    "FreeForm",
    "FrictionOverPosition",
    "InMotion",
    "Pairs",
    "Scanner",
    "beside",
    "candidates_of",
    "causes_of",
    "friction_profile",
    "gate",
    "in_free_form",
    "is_one_profile",
    "likeness",
    "nearest",
    "repeats",
    "search",
    "sets_of",
    "travel_hysteresis",
]
