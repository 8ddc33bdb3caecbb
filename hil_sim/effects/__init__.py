"""Physical effects that the simulator can switch on for an axis, beyond the plain model.

One module per effect; `Effect` says what it has to bring, `EffectPorts` where it enters the plant,
`library` which there are. How to add one: docs/sim-to-real.md.
"""

from hil_sim.effects.effect import AppliedEffect, Effect, Parameter

__all__ = ["AppliedEffect", "Effect", "Parameter"]
