"""A stage without friction whose loops are open: the motor gets the force offset, nothing else."""

import numpy as np
import pytest

from hil_sim.plant import simulate
from tests.unit.hil_sim.inputs import OPEN, change_axes


@pytest.fixture(scope="session")
def free(nominal):
    """No friction, no control, encoders of a picometre."""
    bare = {"coulomb": 1e-9, "viscous": 0.0, "stiffness": 1e-6}
    return change_axes(nominal, bare, {**OPEN, "peak_force": 1e3}, increment=1e-12)


@pytest.fixture(scope="session")
def pushed():
    """Push x with a constant demanded force from t = 0: time and position of x."""

    def run(stage, force, duration=0.1, substeps=50):
        rows = round(duration / stage.sync_period) + 1
        offset = np.tile([force, 0.0], (rows, 1))
        response = simulate(
            stage, np.zeros_like(offset), offset, None, substeps=substeps, rounded=False
        )
        return stage.sync_period * np.arange(rows), response.position[:, 0]

    return run
