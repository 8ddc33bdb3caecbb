"""Detent force between magnets and iron."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class Cogging(Effect):
    """Even without current, the magnets pull the carriage towards certain positions.

    Slots and ends of a linear motor's iron core in the field of the magnet track; also ironless
    motors next to steel parts, and magnets near a steel base.
    """

    name = "cogging"
    group = "force"
    parameters = (
        Parameter(
            "amplitude",
            "N",
            "amplitude of the force",
            (0.06, 0.3),
            relative_to="Coulomb force",
            neutral=0.0,
        ),
        Parameter(
            "pitch",
            "m",
            "spatial period",
            (24e-3, 40e-3),
            role="shape",
            least=1e-3,
            log=True,
            plausible_turning=(0.07, 1.6),  # 2 to 44 pole pairs, driving directly
        ),
        Parameter("phase", "rad", "phase at position 0", None, role="phase"),
    )
    equation = "F_d += amplitude sin(2 pi x/pitch + phase)"
    enters = "A disturbance force over position."
    remedy = (
        "Measure it once at creep speed and feed it forward over position; ironless motors have "
        "hardly any."
    )
    compensation = Compensation(
        "fed forward along the planned path",
        "estimation.known_effects.inverses:cogging",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        angle = 2.0 * np.pi / parameters["pitch"] * ports.positions + parameters["phase"]
        ports.add_position_force(parameters["amplitude"] * np.sin(angle))
