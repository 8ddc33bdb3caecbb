"""A force that repeats with each turn or tooth of the transmission."""

import math
from dataclasses import replace

from hil_sim.effects import phase, pitch
from hil_sim.effects.cogging import Cogging


class TransmissionRipple(Cogging):
    """Screw, belt, rack or gear resist a little more in some angles than in others.

    A bent or eccentric screw and balls entering its nut, a coupling out of line, the mesh of belt
    and rack teeth, the poles of a rotary motor: harmonics of the lead or of the tooth pitch.
    """

    transmission = True
    parameters = (
        replace(Cogging.parameters[0], plausible=(0.02, 0.2)),
        pitch((1e-3, 2e-2), (0.01, 2.0 * math.pi), least=2e-4),
        phase(),
    )
    remedy = (
        "Compare the pitch with the lead, its fractions and the motor's poles: align coupling and "
        "screw, or feed the force forward over position."
    )
