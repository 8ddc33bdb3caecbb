"""Motor torque that varies over the motor's angle."""

import math

from hil_sim.effects import phase, pitch, share
from hil_sim.effects.force_ripple import ForceRipple


class TorqueRipple(ForceRipple):
    """The torque per current of a rotary motor varies with its angle.

    Slots and commutation of the motor behind a screw, belt or gear: harmonics of its turn, seen as
    a short pitch along the travel, and proportional to the current.
    """

    transmission = True
    parameters = (
        share("amplitude over the mean torque", (0.01, 0.1)),
        pitch((1e-3, 2e-2), (0.01, 2.0 * math.pi), least=2e-4),
        phase(),
    )
    remedy = (
        "Correct the commutation angle of the motor; then scale the torque demand with a table "
        "over its angle."
    )
