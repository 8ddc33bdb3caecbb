"""Cables whose pull depends on the direction of motion."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, force, shape


class CableHysteresis(Effect):
    """The pull of a cable lags behind its motion.

    After a reversal it builds up over some tenths of a millimetre and then stays constant. Strands
    and jackets rub against each other in the bend, chain links on their pins; also a wiper on a
    soft seat.
    """

    group = "force"
    parameters = (
        force("force", "sliding force of the element", (0.07, 0.22), least=0.0),
        shape(
            "stiffness",
            "N/m",
            "stiffness before it slides",
            (150.0, 700.0),
            relative_to="Coulomb force",
            above=0.0,
        ),
    )
    equation = "F_d += H, dH = stiffness dx, held within ± force"
    enters = "An elasto-plastic element besides friction: a spring that slides at its force."
    remedy = (
        "Use cables made for continuous flexing, fixed so that nothing rubs; otherwise add the "
        "element to the friction of the feedforward."
    )
    compensation = Compensation(
        "fed forward from a state that follows the measured positions", HOST
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.add_hysteresis(parameters["force"], parameters["stiffness"])
