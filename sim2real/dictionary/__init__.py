"""Where to start fitting each effect of the library beside a model.

`nodes` are the values that are tried, `candidates` scales and ranks what they promise. The caller
says what models are fitted to: tracked innovations or the free loop.
"""

from sim2real.dictionary.candidates import Candidate as Candidate
from sim2real.dictionary.candidates import Dictionary as Dictionary
from sim2real.dictionary.candidates import Linearised as Linearised
from sim2real.dictionary.candidates import shift_only_place as shift_only_place
from sim2real.dictionary.nodes import FIRST_ORDER as FIRST_ORDER
from sim2real.dictionary.nodes import Values as Values
from sim2real.dictionary.nodes import effect_nodes as effect_nodes
from sim2real.dictionary.nodes import typical as typical
