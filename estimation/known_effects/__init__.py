"""Known effects on an axis beside its friction, and their compensation.

`inverses` says for each effect by name what it adds to the `KnownTerms` of its axis; the equations
are the host's own, and share nothing with the simulator's.
"""

from estimation.known_effects.coulomb import coulomb_factor, directions
from estimation.known_effects.forces import KnownForces, Path
from estimation.known_effects.motor import delivered_force, force_to_demand
from estimation.known_effects.terms import F64, KnownTerms, known_figures

__all__ = [
    "F64",
    "KnownForces",
    "KnownTerms",
    "Path",
    "coulomb_factor",
    "delivered_force",
    "directions",
    "force_to_demand",
    "known_figures",
]
