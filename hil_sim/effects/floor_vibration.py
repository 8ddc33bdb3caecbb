"""Vibration from outside."""

from hil_sim.effects import Compensation, Effect, EffectPorts, Values, force, phase, shape


class FloorVibration(Effect):
    """A force excites the axis at one frequency all the time.

    Pumps, chillers and fans acting through hoses and frame, the floor of the building, a fan on the
    axis itself; frequencies near their rotational speed or twice the mains frequency.
    """

    group = "force"
    parameters = (
        force("amplitude", "amplitude of the force", (0.035, 0.1)),
        shape("frequency", "Hz", "frequency of the force", (12.0, 90.0), above=0.0, below=2500.0),
        phase("phase at t = 0"),
    )
    equation = "F_d += amplitude sin(2 pi frequency t + phase)"
    enters = "A disturbance force over time."
    remedy = (
        "Find the source by switching pumps and fans off one by one; decouple it, or improve the "
        "isolation of the machine."
    )
    compensation = Compensation("its phase is another in every run")

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.add_harmonic(parameters["amplitude"], parameters["frequency"], parameters["phase"])
