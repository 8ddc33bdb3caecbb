"""Tables over position and velocity: the force they put on the carriage, and what is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hil_sim.effects.ports import EffectPorts
from hil_sim.effects.residual_table import ResidualTable
from tests.unit.hil_sim.inputs import MASS

LAG = 1.0 / (2.0 * np.pi * 1500.0)
"""Time constant of the current loop [s]."""
TABLE = {
    "position": (-0.05, 0.0, 0.05),
    "force": (1.0, -1.0, 3.0),
    "coulomb": (1.0, 1.2, 0.5),
    "velocity": (-0.4, 0.0, 0.4),
    "velocity_force": (-2.0, 0.0, 1.0),
}


@pytest.mark.parametrize(("substeps", "accuracy"), [(50, 1e-4), (5, 1.5e-3), (1, 1.5e-3)])
@pytest.mark.parametrize("push", [20.0, -20.0])
def test_the_force_is_linear_between_nodes_and_held_beyond(
    free, with_effects, pushed, push, substeps, accuracy
):
    """Against an independent integration to 1e-10."""
    stage = with_effects(free, ResidualTable().at(**TABLE))
    time, position = pushed(stage, push, substeps=substeps, duration=0.3)
    assert np.abs(position).max() > 0.07

    def rates(t, state):
        x, v = state
        force = push * (1.0 - math.exp(-t / LAG))
        force -= np.interp(x, TABLE["position"], TABLE["force"])
        force -= np.interp(v, TABLE["velocity"], TABLE["velocity_force"])
        return v, force / MASS

    expected = solve_ivp(
        rates, (0.0, time[-1]), (0.0, 0.0), t_eval=time, rtol=1e-10, atol=1e-14, max_step=1e-3
    ).y[0]
    assert np.abs(position - expected).max() <= accuracy * np.ptp(expected)


def test_the_factor_is_on_the_coulomb_level(nominal):
    axis = nominal.axes[0]
    ports = EffectPorts(axis, 1e-3, 0.1)
    ResidualTable().at(**TABLE).apply(ports)
    factor = np.interp([-0.1, -0.025, 0.05, 0.1], ports.positions, ports.position_coulomb)
    assert factor == pytest.approx([1.0, 1.1, 0.5, 0.5])


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"force": (1.0, 2.0)}, "force: must have 3 values like position, has 2"),
        ({"coulomb": (1.0, 1.0, -0.1)}, "coulomb: value 3: must be >= 0, is -0.1"),
        ({"coulomb": 1.0}, "coulomb: must be a list of numbers"),
        ({"position": (0.0, 0.0, 0.1)}, "position: must increase from node to node"),
        ({"velocity": (0.0,), "velocity_force": (1.0,)}, "velocity: must have 2 to 1000 nodes"),
        ({"velocity_force": (0.0, np.nan, 1.0)}, "velocity_force: value 2: must be finite"),
        ({"velocity": (-0.4, 0.0, 1e-9)}, r"velocity_force: changes by 1e\+09 N s/m, at most"),
        ({"position": (-0.05, 0.0, 1e-12)}, r"force: changes by 4e\+12 N/m, at most"),
        (
            {"position": (-0.05, 0.0, 1e-12), "force": (0.0, 0.0, 0.0)},
            r"coulomb: changes by \S+e\+12 N/m, at most",
        ),
        ({"coulomb": (1.0, 1.0, 1e3)}, "coulomb: friction of .* N is above the peak force of"),
    ],
)
def test_tables_that_do_not_fit_are_refused(nominal, changed, reason):
    with pytest.raises(ValueError, match=reason):
        ResidualTable().check(TABLE | changed, nominal.axes[0])
