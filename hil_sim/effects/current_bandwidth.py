"""A current loop slower than the machine file says."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class CurrentBandwidth(Effect):
    """The motor current follows its demand more slowly than the drive's data sheet says.

    A current loop tuned for another motor or bus voltage, a different inductance, an active
    demand filter.
    """

    name = "current_bandwidth"
    group = "motor"
    parameters = (
        Parameter(
            "bandwidth",
            "Hz",
            "bandwidth of the first-order current loop",
            (150.0, 450.0),
            neutral="current_bandwidth",
            above=0.0,
            log=True,
        ),
    )
    equation = "current loop of this bandwidth [Hz]"
    enters = "Replaces the bandwidth of the current loop; the force actual value shows it."
    remedy = (
        "Retune the current loop for this motor and disable demand filters; until then, evaluate "
        "the feedforward further ahead."
    )
    compensation = Compensation(
        "the feedforward leads by the lag of this current loop",
        "estimation.known_effects.inverses:current_bandwidth",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.current_bandwidth = parameters["bandwidth"]
