"""Viscous friction that depends on the direction of motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class ViscousAsymmetry(Effect):
    """Friction grows faster with speed in one direction than in the other.

    Screws and worm gears whose flanks carry differently, a nut or seal that drags lubricant one
    way, gears with other losses when driven back, wipers that pump.
    """

    name = "viscous_asymmetry"
    group = "friction"
    transmission = True
    parameters = (
        Parameter(
            "ratio",
            "",
            "half the difference between the directions over their mean",
            (0.05, 0.4),
            signed=True,
            neutral=0.0,
            above=-1.0,
            below=1.0,
        ),
    )
    equation = "sigma_v * (1 + ratio sgn v)"
    enters = "A factor on sigma_v for each direction."
    remedy = (
        "Feed viscous friction forward with one coefficient per direction; check lubricant, seals "
        "and the alignment of screw and nut."
    )
    compensation = Compensation(
        "fed forward along the planned path",
        "estimation.known_effects.inverses:viscous_asymmetry",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.add_velocity_force(parameters["ratio"] * ports.viscous * np.abs(ports.velocities))
