"""Known effects on an axis beside its friction, and their compensation.

`inverses` says for each effect by name what it adds to the `KnownTerms` of its axis; the equations
are the host's own, and share nothing with the simulator's.
"""

from estimation.known_effects.factors import coulomb_factor as coulomb_factor
from estimation.known_effects.factors import delivered_force as delivered_force
from estimation.known_effects.factors import directions as directions
from estimation.known_effects.factors import force_to_demand as force_to_demand
from estimation.known_effects.forces import KnownForces as KnownForces
from estimation.known_effects.forces import Path as Path
from estimation.known_effects.terms import KnownTerms as KnownTerms
from estimation.known_effects.terms import known_figures as known_figures
from stagedata import F64 as F64
