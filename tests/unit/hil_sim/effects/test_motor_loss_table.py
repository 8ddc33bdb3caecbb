"""A loss of motor force as a table: the force that reaches the carriage, and what is refused."""

import numpy as np
import pytest

from hil_sim.effects.motor_loss_table import MotorLossTable
from hil_sim.effects.ports import EffectPorts
from tests.unit.hil_sim.inputs import MASS

DEAD_ZONE = {"motor_force": (-60.0, -2.0, 2.0, 60.0), "loss": (-2.0, -2.0, 2.0, 2.0)}


@pytest.mark.parametrize(("push", "rest"), [(10.0, 8.0), (-10.0, -8.0), (1.5, 0.0)])
def test_what_is_lost_does_not_move_the_carriage(free, with_effects, pushed, push, rest):
    time, position = pushed(with_effects(free, MotorLossTable().at(**DEAD_ZONE)), push)
    late = len(time) // 2
    acceleration = 2.0 * np.polyfit(time[late:], position[late:], 2)[0]
    assert acceleration == pytest.approx(rest / MASS, abs=0.02 * abs(push) / MASS)


def test_it_is_held_beyond_its_ends(nominal):
    ports = EffectPorts(nominal.axes[0], 1e-3, 0.1)
    MotorLossTable().at(**DEAD_ZONE).apply(ports)
    assert ports.motor_loss[[0, -1]] == pytest.approx([-2.0, 2.0])


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"loss": (0.0, 1.0)}, "loss: must have 4 values like motor_force, has 2"),
        ({"motor_force": (0.0, 0.0, 1.0, 2.0)}, "motor_force: must increase from node to node"),
        ({"loss": (-3.0, -3.0, 3.0, 3.0)}, "loss: rises by 1.5 N per N, at most 1"),
    ],
)
def test_tables_that_do_not_fit_are_refused(nominal, changed, reason):
    with pytest.raises(ValueError, match=reason):
        MotorLossTable().check(DEAD_ZONE | changed, nominal.axes[0])
