"""Motor torque that varies over the motor's angle."""

from __future__ import annotations

import math
from dataclasses import replace

from hil_sim.effects.force_ripple import ForceRipple

_RATIO, _PITCH, _PHASE = ForceRipple.parameters


class TorqueRipple(ForceRipple):
    """The torque per current of a rotary motor varies with its angle.

    Slots and commutation of the motor behind a screw, belt or gear: harmonics of its turn, seen as
    a short pitch along the travel, and proportional to the current.
    """

    name = "torque_ripple"
    transmission = True
    parameters = (
        replace(_RATIO, meaning="amplitude over the mean torque", plausible=(0.01, 0.1)),
        replace(
            _PITCH,
            plausible=(1e-3, 2e-2),
            least=2e-4,
            plausible_turning=(0.01, 2.0 * math.pi),
        ),
        _PHASE,
    )
    remedy = (
        "Correct the commutation angle of the motor; then scale the torque demand with a table "
        "over its angle."
    )
