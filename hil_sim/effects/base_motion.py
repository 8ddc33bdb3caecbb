"""The machine base that yields to the axis' force."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class BaseMotion(Effect):
    """The base rocks on its isolators when the axis pushes off.

    Granite on air springs or rubber pads, a light frame on a soft floor: some hertz, little
    damping; the encoder reads the carriage relative to the base.
    """

    name = "base_motion"
    group = "dynamics"
    parameters = (
        Parameter(
            "frequency",
            "Hz",
            "of the base on its isolators",
            (5.0, 15.0),
            role="shape",
            above=0.0,
            below=1500.0,
            log=True,
        ),
        Parameter(
            "damping",
            "",
            "ratio of that mode",
            (0.04, 0.15),
            role="shape",
            least=0.0,
            below=1.0,
            log=True,
        ),
        Parameter(
            "mass_ratio",
            "",
            "moved mass over the base's",
            (0.01, 0.05),
            neutral=0.0,
            least=0.0,
            below=1.0,
        ),
    )
    equation = (
        "base of mass m/mass_ratio on isolators takes the reaction of F_motor - F_f - F_d; x "
        "is relative to it"
    )
    enters = (
        "The base is a mass on a spring and damper under the axis; positions are relative to it."
    )
    remedy = (
        "Heavier base, stiffer or active isolators, or feed the reaction forward; lower jerk "
        "excites it less."
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.mount(parameters["mass_ratio"], parameters["frequency"], parameters["damping"])
