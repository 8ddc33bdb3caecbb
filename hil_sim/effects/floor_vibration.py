"""Vibration from outside."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class FloorVibration(Effect):
    """A force excites the axis at one frequency all the time.

    Pumps, chillers and fans acting through hoses and frame, the floor of the building, a fan on the
    axis itself; frequencies near their rotational speed or twice the mains frequency.
    """

    name = "floor_vibration"
    group = "force"
    parameters = (
        Parameter(
            "amplitude",
            "N",
            "amplitude of the force",
            (0.035, 0.1),
            relative_to="Coulomb force",
            neutral=0.0,
        ),
        Parameter(
            "frequency",
            "Hz",
            "frequency of the force",
            (12.0, 90.0),
            role="shape",
            above=0.0,
            below=2500.0,
            log=True,
        ),
        Parameter("phase", "rad", "phase at t = 0", None, role="phase"),
    )
    equation = "F_d += amplitude sin(2 pi frequency t + phase)"
    enters = "A disturbance force over time."
    remedy = (
        "Find the source by switching pumps and fans off one by one; decouple it, or improve the "
        "isolation of the machine."
    )
    compensation = Compensation("its phase is another in every run")

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.add_harmonic(parameters["amplitude"], parameters["frequency"], parameters["phase"])
