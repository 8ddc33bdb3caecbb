"""Friction at creep speed that differs from that of sliding."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts

_ROUNDED = 0.2
"""Share of `speed` over which the force passes through zero at a reversal, which presliding does
for the other friction."""


class LowSpeedFriction(Effect):
    """Friction departs from its level below some speed: it falls off, or rises further.

    Balls of a screw or guide that roll in their own wedge of grease, a nut that creeps over its
    preload, belts and gears that carry little until their slack is taken up; sticky seals and worn
    guides instead rise.
    """

    name = "low_speed_friction"
    group = "friction"
    transmission = True
    parameters = (
        Parameter(
            "ratio",
            "",
            "excess at lowest speed over Fc",
            (0.2, 0.9),
            signed=True,
            neutral=0.0,
            above=-2.0,
        ),
        Parameter(
            "speed",
            "m/s",
            "speed over which it decays",
            (2e-3, 4e-2),
            role="shape",
            relative_to="velocity limit",
            above=0.0,
            log=True,
        ),
    )
    equation = "F_d += Fc ratio tanh(5 v/speed) exp(-abs(v)/speed)"
    enters = "A disturbance force over velocity, besides the Stribeck curve."
    remedy = (
        "Identify friction at creep speed apart from that of sliding, and feed it forward over "
        "speed; a low level there calls for less compensation at reversals."
    )
    compensation = Compensation(
        "fed forward along the planned path",
        "estimation.known_effects.inverses:low_speed_friction",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        level = ports.axis.friction.coulomb * parameters["ratio"]
        share = ports.velocities / parameters["speed"]
        ports.add_velocity_force(level * np.tanh(share / _ROUNDED) * np.exp(-np.abs(share)))
