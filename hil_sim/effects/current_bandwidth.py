"""A current loop slower than the machine file says."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, size


class CurrentBandwidth(Effect):
    """The motor current follows its demand more slowly than the drive's data sheet says.

    A current loop tuned for another motor or bus voltage, a different inductance, an active
    demand filter.
    """

    group = "motor"
    parameters = (
        size(
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
    compensation = Compensation("the feedforward leads by the lag of this current loop", HOST)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.current_bandwidth = parameters["bandwidth"]
