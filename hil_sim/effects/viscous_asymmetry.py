"""Viscous friction that depends on the direction of motion."""

import numpy as np

from hil_sim.effects import FED_FORWARD, Effect, EffectPorts, Values, asymmetry


class ViscousAsymmetry(Effect):
    """Friction grows faster with speed in one direction than in the other.

    Screws and worm gears whose flanks carry differently, a nut or seal that drags lubricant one
    way, gears with other losses when driven back, wipers that pump.
    """

    group = "friction"
    transmission = True
    parameters = (asymmetry((0.05, 0.4)),)
    equation = "sigma_v * (1 + ratio sgn v)"
    enters = "A factor on sigma_v for each direction."
    remedy = (
        "Feed viscous friction forward with one coefficient per direction; check lubricant, seals "
        "and the alignment of screw and nut."
    )
    compensation = FED_FORWARD

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.add_velocity_force(parameters["ratio"] * ports.viscous * np.abs(ports.velocities))
