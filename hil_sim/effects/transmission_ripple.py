"""A force that repeats with each turn or tooth of the transmission."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class TransmissionRipple(Effect):
    """Screw, belt, rack or gear resist a little more in some angles than in others.

    A bent or eccentric screw and balls entering its nut, a coupling out of line, the mesh of belt
    and rack teeth, the poles of a rotary motor: harmonics of the lead or of the tooth pitch.
    """

    name = "transmission_ripple"
    group = "force"
    transmission = True
    parameters = (
        Parameter(
            "amplitude",
            "N",
            "amplitude of the force",
            (0.02, 0.2),
            neutral=0.0,
            relative_to="Coulomb force",
        ),
        Parameter("pitch", "m", "spatial period", (1e-3, 2e-2), role="shape", least=2e-4, log=True),
        Parameter("phase", "rad", "phase at position 0", None, role="phase"),
    )
    equation = "F_d += amplitude sin(2 pi x/pitch + phase)"
    enters = "A disturbance force over position."
    remedy = (
        "Compare the pitch with the lead, its fractions and the motor's poles: align coupling and "
        "screw, or feed the force forward over position."
    )
    compensation = Compensation(
        "fed forward along the planned path",
        "estimation.known_effects.inverses:cogging",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        angle = 2.0 * np.pi / parameters["pitch"] * ports.positions + parameters["phase"]
        ports.add_position_force(parameters["amplitude"] * np.sin(angle))
