"""Viscous friction that depends on the direction of motion."""

import numpy as np

from hil_sim.effects import FED_FORWARD, Effect, EffectPorts, Values, share


class ViscousAsymmetry(Effect):
    """Friction grows faster with speed in one direction than in the other.

    Screws and worm gears whose flanks carry differently, a nut or seal that drags lubricant one
    way, gears with other losses when driven back, wipers that pump.
    """

    name = "viscous_asymmetry"
    group = "friction"
    transmission = True
    parameters = (
        share(
            "half the difference between the directions over their mean", (0.05, 0.4), signed=True
        ),
    )
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
