"""A part of the moved mass that swings on the carriage."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Effect
from hil_sim.effects.mode import mode_parameters
from hil_sim.effects.ports import EffectPorts


class Resonance(Effect):
    """Something on the carriage is not rigidly fixed.

    A chuck on a thin adapter, a Z stage or optics head on its bearing, a cable chain's end, a
    plate that bends: motor and encoder act on one part, the other follows through a spring.
    """

    name = "resonance"
    group = "dynamics"
    parameters = mode_parameters(
        frequency=("of the free-free mode", (70.0, 160.0)),
        damping=("ratio of the free-free mode", (0.01, 0.04)),
        mass_ratio=("swinging mass over moved mass", (0.1, 0.3)),
    )
    equation = (
        "mass_ratio * m hangs on a spring and damper from the carriage that motor and encoder "
        "act on; frequency and damping ratio of the free-free mode"
    )
    enters = (
        "The moved mass is split: the rest is the carriage, a spring and a damper lead to the "
        "swinging part."
    )
    remedy = (
        "Stiffen the joint or damp it; a notch at that frequency and smoother jerk help until then."
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.hang(parameters["mass_ratio"], parameters["frequency"], parameters["damping"])
