"""Tables over position and velocity: the force they put on the carriage, and what is refused."""

import numpy as np
import pytest

from hil_sim.effects.ports import EffectPorts
from hil_sim.effects.residual_table import ResidualTable
from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)

TABLE = {
    "position": (-0.05, 0.0, 0.05),
    "force": (1.0, -1.0, 3.0),
    "coulomb": (1.0, 1.2, 0.5),
    "velocity": (-0.4, 0.0, 0.4),
    "velocity_force": (-2.0, 0.0, 1.0),
}


@every_step
@pytest.mark.parametrize("push", [20.0, -20.0])
def test_the_force_is_linear_between_nodes_and_held_beyond(
    free, with_effects, pushed, push, substeps, accuracy
):
    stage = with_effects(free, ResidualTable().at(**TABLE))
    time, position, _ = pushed(stage, push, substeps=substeps, duration=0.3)
    assert np.abs(position).max() > 0.07

    def against(x, v):
        return np.interp(x, TABLE["position"], TABLE["force"]) + np.interp(
            v, TABLE["velocity"], TABLE["velocity_force"]
        )

    expected = integrated(time, lambda t, x, v: (motor(t, push) - against(x, v)) / MASS)
    assert_close(position, expected, accuracy)


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
