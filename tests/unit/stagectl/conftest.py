"""Data of another program, for what reads it."""

import numpy as np
import pytest

from hil_sim.plant import simulate
from stagectl.config import stage_settings
from stagectl.config.import_map import load_map
from tests.unit.stagectl.logged_data import EXAMPLE


@pytest.fixture(scope="session")
def columns():
    """What the example's machine would have logged, in the data's own columns and units."""
    _, machine = load_map(EXAMPLE / "map.yaml")
    settings = stage_settings(machine)
    t = np.arange(3000) * 1e-3
    demand = (0.05 * np.sin(np.pi * t) ** 2)[:, None]
    response = simulate(settings, demand, np.zeros_like(demand), None)
    volts = response.force[:, 0] / 35.15065188248547
    return {
        "t": t, "qg": demand[:, 0], "qm": response.position[:, 0],
        "vir": np.concatenate((volts[1:], volts[-1:])),
    }  # fmt: skip
