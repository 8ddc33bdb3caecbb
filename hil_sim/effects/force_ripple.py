"""Motor force that varies along the magnet track."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class ForceRipple(Effect):
    """The force per current varies with position.

    A back-EMF that is not sinusoidal, commutation steps or a wrong commutation angle, unequal
    coils: harmonics of the electrical period, proportional to the current.
    """

    name = "force_ripple"
    group = "motor"
    parameters = (
        Parameter(
            "ratio",
            "",
            "amplitude over the mean force",
            (0.03, 0.08),
            neutral=0.0,
            above=-1.0,
            below=1.0,
        ),
        Parameter(
            "pitch",
            "m",
            "spatial period",
            (8e-3, 14e-3),
            role="shape",
            least=1e-3,
            log=True,
            plausible_turning=(0.02, 0.5),  # thirds of the poles of such a motor: 2 to 44 pairs
        ),
        Parameter("phase", "rad", "phase at position 0", None, role="phase"),
    )
    equation = "F_motor * (1 + ratio sin(2 pi x/pitch + phase))"
    enters = (
        "A factor on the motor force over position, after saturation; the force actual value "
        "does not show it."
    )
    remedy = (
        "Correct the commutation angle first; then scale the force demand with a table over "
        "position."
    )
    compensation = Compensation(
        "the force demand is divided by it along the planned path",
        "estimation.known_effects.inverses:force_ripple",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        angle = 2.0 * np.pi / parameters["pitch"] * ports.positions + parameters["phase"]
        ports.scale_position_gain(1.0 + parameters["ratio"] * np.sin(angle))
