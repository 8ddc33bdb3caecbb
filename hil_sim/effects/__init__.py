"""Physical effects beyond the plain model, which a machine file can add to an axis.

One module per effect: `Effect` is what it implements, `EffectPorts` where it enters the plant,
`parameter` makes its parameters, `library` lists those installed. How to add one:
docs/sim-to-real.md.
"""

from hil_sim.effects.effect import (
    FED_FORWARD,
    FRICTION_FACTOR,
    HOST,
    STARTED_WITH,
    AppliedEffect,
    Compensation,
    Effect,
    Values,
)
from hil_sim.effects.parameter import (
    Parameter,
    Value,
    factor,
    force,
    mass,
    oscillator,
    phase,
    pitch,
    place,
    shape,
    share,
    size,
)
from hil_sim.effects.ports import EffectPorts

__all__ = [
    "FED_FORWARD",
    "FRICTION_FACTOR",
    "HOST",
    "STARTED_WITH",
    "AppliedEffect",
    "Compensation",
    "Effect",
    "EffectPorts",
    "Parameter",
    "Value",
    "Values",
    "factor",
    "force",
    "mass",
    "oscillator",
    "phase",
    "pitch",
    "place",
    "shape",
    "share",
    "size",
]
