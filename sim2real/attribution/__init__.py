"""Which effects explain the gap of an axis.

`search` selects effects one at a time. `tracked` is the dictionary of candidates beside a model
fitted to innovations, with first-order `signature`s; `alternatives` scores the sets of effects
fitted, `refinement` fits close ones to convergence, and `similarity` compares their signatures.
`shape_check` recognises an effect of the right family in another shape, `free_form` friction over
position in any (`friction_profile`, on `residual_force`). `closed_loop_check` drops what does not
show in the free-run gap, and `causes` puts probabilities and sigmas to what remains. What was
chosen for all of this is in `sim2real.scoring.constants`.
"""

from sim2real.attribution.alternatives import of_size
from sim2real.attribution.causes import find_causes, list_candidates
from sim2real.attribution.closed_loop_check import drop_invisible, measure_closed
from sim2real.attribution.free_form import FreeForm, FreeFormTest, FrictionOverPosition
from sim2real.attribution.friction_profile import fit_friction_profile
from sim2real.attribution.residual_force import stop_operators
from sim2real.attribution.search import AxisSearch, refit_beside, search_effects
from sim2real.attribution.shape_check import (
    are_harmonics,
    fit_repeats,
    free_form_repeat,
    is_one_profile,
)
from sim2real.attribution.similarity import Pairs, signature_similarity
from sim2real.attribution.tracked import TrackedDictionary

__all__ = [
    "AxisSearch",
    "FreeForm",
    "FreeFormTest",
    "FrictionOverPosition",
    "Pairs",
    "TrackedDictionary",
    "are_harmonics",
    "drop_invisible",
    "find_causes",
    "fit_friction_profile",
    "fit_repeats",
    "free_form_repeat",
    "is_one_profile",
    "list_candidates",
    "measure_closed",
    "of_size",
    "refit_beside",
    "search_effects",
    "signature_similarity",
    "stop_operators",
]
