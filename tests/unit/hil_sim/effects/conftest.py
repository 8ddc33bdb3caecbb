"""A stage without friction whose loops are open: the motor gets the force offset, nothing else."""

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim.plant import simulate
from tests.unit.hil_sim.inputs import OPEN, change_axes

F64 = NDArray[np.float64]


@pytest.fixture(scope="session")
def free(nominal):
    """No friction, no control, encoders of a picometre."""
    bare = {"coulomb": 1e-9, "viscous": 0.0, "stiffness": 1e-6}
    return change_axes(nominal, bare, {**OPEN, "peak_force": 1e3}, increment=1e-12)


@pytest.fixture(scope="session")
def pushed():
    """Push x (and y) with a constant demanded force from t = 0: time, position and force of x."""

    def run(
        stage,
        force,
        *,
        start=0.0,
        across=0.0,
        duration=0.1,
        substeps=50,
        axis=0,
    ):
        rows = round(duration / stage.sync_period) + 1
        demand = np.tile([start, 0.0], (rows, 1))
        offset = np.tile([force, across], (rows, 1))
        response = simulate(stage, demand, offset, None, substeps=substeps, rounded=False)
        time = stage.sync_period * np.arange(rows)
        return time, response.position[:, axis], response.force[:, axis]

    return run
