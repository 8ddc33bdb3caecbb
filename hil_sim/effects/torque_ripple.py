"""Motor torque that varies over the motor's angle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class TorqueRipple(Effect):
    """The torque per current of a rotary motor varies with its angle.

    Slots and commutation of the motor behind a screw, belt or gear: harmonics of its turn, seen as
    a short pitch along the travel, and proportional to the current.
    """

    name = "torque_ripple"
    group = "motor"
    transmission = True
    parameters = (
        Parameter(
            "ratio",
            "",
            "amplitude over the mean torque",
            (0.01, 0.1),
            neutral=0.0,
            above=-1.0,
            below=1.0,
        ),
        Parameter("pitch", "m", "spatial period", (1e-3, 2e-2), role="shape", least=2e-4, log=True),
        Parameter("phase", "rad", "phase at position 0", None, role="phase"),
    )
    equation = "F_motor * (1 + ratio sin(2 pi x/pitch + phase))"
    enters = (
        "A factor on the motor force over position, after saturation; the force actual value "
        "does not show it."
    )
    remedy = (
        "Correct the commutation angle of the motor; then scale the torque demand with a table "
        "over its angle."
    )
    compensation = Compensation(
        "the force demand is divided by it along the planned path",
        "estimation.known_effects.inverses:force_ripple",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        angle = 2.0 * np.pi / parameters["pitch"] * ports.positions + parameters["phase"]
        ports.scale_position_gain(1.0 + parameters["ratio"] * np.sin(angle))
