"""The friction laws of the simulated plant by name, each in a module of its own.

They are the simulator's truth; the estimator has laws of its own (`estimation.friction`) and never
sees these. In a step of `hil_sim.plant.mechanics` a law acts either before the displacement
(`coulomb.hold` finds the force that would stop the axis in this step, up to its limit) or after it
(`gms.slip_step` gives the force for the next step). A new law is a module, its number here, and its
line in `mechanics` and in `inverse`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.plant.friction.gms import balance
from stagedata import F64, FrictionFigures, LawName

GMS, COULOMB = range(2)
NUMBERS: Mapping[LawName, int] = {"gms": GMS, "coulomb": COULOMB}
"""Name of a law -> its number in kernels."""


def rest_forces(friction: FrictionFigures, static: float, force: float) -> tuple[F64, float]:
    """Internal forces at rest and their sum, where friction holds `force` as far as it can.

    Args:
        friction: of the axis.
        static: Fs, effects included [N].
        force: on the axis without friction [N].
    """
    if friction.law == "gms":
        forces = balance(friction.elements, static, force)
        return forces, float(forces.sum())
    return np.zeros(0), min(max(force, -static), static)
