"""Which effects explain the gap of an axis.

`search` selects effects one at a time. `candidates` is the dictionary beside a model fitted to
innovations, with first-order `signature`s; `alternatives` fits, refines and scores sets of effects,
and `similarity` compares their signatures. `levels` weighs effects on the Coulomb level.
`axis_search` holds what was found, checks it against the free-run gap and hands it to the free
loop; `causes` puts probabilities and sigmas to what remains. What was chosen for all of this is in
`sim2real.scoring.constants`.
"""

from sim2real.attribution.alternatives import of_size as of_size
from sim2real.attribution.axis_search import AxisResult as AxisResult
from sim2real.attribution.axis_search import AxisSearch as AxisSearch
from sim2real.attribution.axis_search import drop_invisible as drop_invisible
from sim2real.attribution.axis_search import measure_closed as measure_closed
from sim2real.attribution.causes import find_causes as find_causes
from sim2real.attribution.causes import list_candidates as list_candidates
from sim2real.attribution.search import factor_instead as factor_instead
from sim2real.attribution.search import search_effects as search_effects
from sim2real.attribution.similarity import Pairs as Pairs
from sim2real.attribution.similarity import signature_similarity as signature_similarity
