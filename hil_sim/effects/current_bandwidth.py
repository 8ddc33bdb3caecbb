"""Current loop slower than believed."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class CurrentBandwidth(Effect):
    """The motor's current follows its demand more slowly than the drive's data sheet says.

    Current loop tuned for another motor or bus voltage, inductance that differs, a demand
    filter that somebody switched on.
    """

    name = "current_bandwidth"
    group = "motor"
    parameters = (
        Parameter(
            "bandwidth",
            "Hz",
            "of the first-order current loop",
            (150.0, 450.0),
            neutral="current_bandwidth",
            above=0.0,
            log=True,
        ),
    )
    equation = "current loop of this bandwidth [Hz] instead"
    enters = "The bandwidth of the current loop, in its place; the force actual value shows it."
    remedy = (
        "Retune the current loop for this motor and switch demand filters off; meanwhile "
        "evaluate feedforward further ahead."
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.current_bandwidth = parameters["bandwidth"]
