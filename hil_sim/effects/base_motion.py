"""A machine base that yields to the reaction force of the axis."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, oscillator


class BaseMotion(Effect):
    """The base rocks on its isolators when the axis accelerates.

    Granite on air springs or rubber pads, a light frame on a soft floor: a few hertz, lightly
    damped. The encoder reads the carriage relative to the base.
    """

    group = "dynamics"
    parameters = oscillator(
        frequency=("frequency of the base on its isolators", (5.0, 30.0)),
        damping=("damping ratio of that mode", (0.04, 0.15)),
        mass_ratio=("moved mass over mass of the base", (0.01, 0.05)),
    )
    equation = (
        "base of mass m/mass_ratio on isolators takes the reaction of F_motor - F_f - F_d; x "
        "is relative to it"
    )
    enters = (
        "The base is a mass on a spring and damper under the axis; positions are relative to it."
    )
    remedy = (
        "Use a heavier base, stiffer or active isolators, or feed the reaction forward; lower "
        "jerk excites it less."
    )
    compensation = Compensation(
        "the base's swing under the demanded acceleration is fed forward, at rest too", HOST
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.mount(parameters["mass_ratio"], parameters["frequency"], parameters["damping"])
