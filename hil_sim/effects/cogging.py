"""Detent force between magnets and iron."""

import numpy as np

from hil_sim.effects import FED_FORWARD, Effect, EffectPorts, Values, force, phase, pitch


class Cogging(Effect):
    """Even without current, the magnets pull the carriage towards certain positions.

    Slots and ends of a linear motor's iron core in the field of the magnet track; also ironless
    motors next to steel parts, and magnets near a steel base.
    """

    group = "force"
    parameters = (
        force("amplitude", "amplitude of the force", (0.06, 0.3)),
        pitch((24e-3, 40e-3), (0.07, 1.6)),  # turning: 2 to 44 pole pairs, driving directly
        phase(),
    )
    equation = "F_d += amplitude sin(2 pi x/pitch + phase)"
    enters = "A disturbance force over position."
    remedy = (
        "Measure it once at creep speed and feed it forward over position; ironless motors have "
        "hardly any."
    )
    compensation = FED_FORWARD

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        angle = 2.0 * np.pi / parameters["pitch"] * ports.positions + parameters["phase"]
        ports.add_position_force(parameters["amplitude"] * np.sin(angle))
