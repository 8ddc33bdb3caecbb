"""Motor force that varies along the magnet track."""

import numpy as np

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, phase, pitch, share


class ForceRipple(Effect):
    """The force per current varies with position.

    A back-EMF that is not sinusoidal, commutation steps or a wrong commutation angle, unequal
    coils: harmonics of the electrical period, proportional to the current.
    """

    group = "motor"
    parameters = (
        share("amplitude over the mean force", (0.03, 0.08)),
        pitch((8e-3, 14e-3), (0.02, 0.5)),  # turning: thirds of the poles, 2 to 44 pairs
        phase(),
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
    compensation = Compensation("the force demand is divided by it along the planned path", HOST)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        angle = 2.0 * np.pi / parameters["pitch"] * ports.positions + parameters["phase"]
        ports.scale_position_gain(1.0 + parameters["ratio"] * np.sin(angle))
