"""Which effects explain the gap of an axis.

`search` selects effects one at a time. `candidates` is the dictionary beside a model fitted to
innovations, with first-order `signature`s; `alternatives` fits, refines and scores sets of effects,
and `similarity` compares their signatures. `shape_check` recognises an effect of the right family
in another shape, `free_form` friction over position in any (`friction_profile`), `levels` effects
on the Coulomb level. `axis_search` holds what was found, checks it against the free-run gap and
hands it to the free loop; `causes` puts probabilities and sigmas to what remains. What was chosen
for all of this is in `sim2real.scoring.constants`.
"""

from sim2real.attribution.alternatives import of_size
from sim2real.attribution.axis_search import AxisResult, AxisSearch, drop_invisible, measure_closed
from sim2real.attribution.causes import find_causes, list_candidates
from sim2real.attribution.free_form import FreeFormTest, FrictionOverPosition
from sim2real.attribution.search import search_effects
from sim2real.attribution.shape_check import fit_repeats, free_form_repeat, is_one_profile
from sim2real.attribution.similarity import Pairs, signature_similarity

__all__ = [
    "AxisResult",
    "AxisSearch",
    "FreeFormTest",
    "FrictionOverPosition",
    "Pairs",
    "drop_invisible",
    "find_causes",
    "fit_repeats",
    "free_form_repeat",
    "is_one_profile",
    "list_candidates",
    "measure_closed",
    "of_size",
    "search_effects",
    "signature_similarity",
]
