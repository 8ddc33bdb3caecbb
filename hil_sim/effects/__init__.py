"""Physical effects beyond the plain model, which a machine file can add to an axis.

One module per effect: `Effect` is what it implements, `EffectPorts` where it enters the plant,
`library` lists those installed. How to add one: docs/sim-to-real.md.
"""

from hil_sim.effects.effect import AppliedEffect, Compensation, Effect, Parameter

__all__ = ["AppliedEffect", "Compensation", "Effect", "Parameter"]
