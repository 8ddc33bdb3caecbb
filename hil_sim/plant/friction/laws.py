"""The friction laws of the simulated plant by name, each in a module of its own.

They are the simulator's truth; the estimator has laws of its own (`estimation.friction`) and never
sees these. In a step (`hil_sim.plant.mechanics.advance`) a law acts where the force that holds an
axis at rest follows from where it would go (`coulomb.hold`), or after the displacement, for the
step to come (`gms.slip_step`). A new law is a module, its number here, and its line there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant.friction.gms import balance
from stagedata import FrictionFigures, LawName

F64 = NDArray[np.float64]

GMS, COULOMB = range(2)
NUMBERS: Mapping[LawName, int] = {"gms": GMS, "coulomb": COULOMB}
"""How kernels know the laws."""


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
