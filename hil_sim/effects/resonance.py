"""A part of the moved mass that oscillates on the carriage."""

from hil_sim.effects import Compensation, Effect, EffectPorts, Values, oscillator


class Resonance(Effect):
    """A part of the moved mass is not rigidly fixed to the carriage.

    A chuck on a thin adapter, a Z stage or optics head on its bearing, the end of a cable chain, a
    plate that bends: motor and encoder act on one part, the other follows through a spring.
    """

    group = "dynamics"
    parameters = oscillator(
        frequency=("frequency of the free-free mode", (70.0, 160.0)),
        damping=("damping ratio of the free-free mode", (0.01, 0.04)),
        mass_ratio=("oscillating mass over moved mass", (0.1, 0.3)),
    )
    equation = (
        "mass_ratio * m is attached to the carriage by a spring and damper; motor and encoder act "
        "on the carriage; frequency and damping ratio of the free-free mode"
    )
    enters = (
        "The moved mass is split: one part is the carriage, a spring and a damper connect it to "
        "the other."
    )
    remedy = (
        "Stiffen or damp the joint; until then, use a notch filter at that frequency and lower "
        "jerk."
    )
    compensation = Compensation(
        "it swings beyond the bandwidth of the position loop, and the encoder sees one part only"
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.hang(parameters["mass_ratio"], parameters["frequency"], parameters["damping"])
