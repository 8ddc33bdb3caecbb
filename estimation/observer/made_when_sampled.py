"""How far a motion has got between two setpoints when the drive samples the position, compiled."""

from stagedata.compiled import kernel


@kernel()
def made_when_sampled(step, coming, share):  # type: ignore[no-untyped-def]
    """Way from one setpoint towards the next that is made at a share of the period between them.

    The motion is smooth (`estimation.acceleration_feedforward`): a parabola through three
    setpoints, not the chord along which the drive interpolates.

    Args:
        step: from the setpoint to the next one.
        coming: the step after that.
        share: of the period that has passed: the drive's first tick when it samples.
    """
    return share * (step - 0.5 * (1.0 - share) * (coming - step))
