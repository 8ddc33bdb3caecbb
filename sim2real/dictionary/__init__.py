"""Where to start fitting each effect of the library beside a model.

`nodes` are the values that are tried, `candidates` scales and ranks what they promise. The caller
says what models are fitted to: tracked innovations or the free loop.
"""

from sim2real.dictionary.candidates import Candidate, Dictionary, Linearised, shift_only_place
from sim2real.dictionary.nodes import FIRST_ORDER, Values, effect_nodes, typical

__all__ = [
    "FIRST_ORDER",
    "Candidate",
    "Dictionary",
    "Linearised",
    "Values",
    "effect_nodes",
    "shift_only_place",
    "typical",
]
