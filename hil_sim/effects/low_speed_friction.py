"""Friction at creep speed that differs from that of sliding."""

import numpy as np

from hil_sim.effects import FED_FORWARD, Effect, EffectPorts, Values, shape, size

_ROUNDED = 0.2
"""Share of `speed` over which the force passes through zero at a reversal, which presliding does
for the other friction."""


class LowSpeedFriction(Effect):
    """Friction departs from its level below some speed: it falls off, or rises further.

    Balls of a screw or guide that roll in their own wedge of grease, a nut that creeps over its
    preload, belts and gears that carry little until their slack is taken up; sticky seals and worn
    guides instead rise.
    """

    group = "friction"
    transmission = True
    parameters = (
        size("ratio", "", "excess at lowest speed over Fc", (0.2, 0.9), signed=True, above=-2.0),
        shape(
            "speed",
            "m/s",
            "speed over which it decays",
            (2e-3, 4e-2),
            relative_to="velocity limit",
            above=0.0,
        ),
    )
    equation = "F_d += Fc ratio tanh(5 v/speed) exp(-abs(v)/speed)"
    enters = "A disturbance force over velocity, besides the Stribeck curve."
    remedy = (
        "Identify friction at creep speed apart from that of sliding, and feed it forward over "
        "speed; a low level there calls for less compensation at reversals."
    )
    compensation = FED_FORWARD

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        level = ports.axis.friction.coulomb * parameters["ratio"]
        share = ports.velocities / parameters["speed"]
        ports.add_velocity_force(level * np.tanh(share / _ROUNDED) * np.exp(-np.abs(share)))
