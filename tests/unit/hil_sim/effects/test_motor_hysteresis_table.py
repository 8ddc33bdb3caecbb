"""Motor force that lags behind, as a table: what reaches the carriage, and what is refused."""

import numpy as np
import pytest

from hil_sim.effects.motor_hysteresis_table import MotorHysteresisTable
from hil_sim.plant import force_along, simulate
from tests.unit.hil_sim.inputs import MASS

IRON = {"width": (2.0, 20.0), "loss": (0.5, 2.0)}


def lagging(force):
    """What two elements lose of a course of the motor force."""
    lost, shares = [], np.zeros(2)
    for change in np.diff(force, prepend=0.0):
        shares = np.clip(shares + change / np.array(IRON["width"]), -1.0, 1.0)
        lost.append(shares @ IRON["loss"])
    return np.array(lost)


@pytest.fixture
def ironed(free, with_effects):
    return with_effects(free, MotorHysteresisTable().at(**IRON))


def test_what_lags_does_not_move_the_carriage(ironed):
    time = ironed.sync_period * np.arange(400)
    wanted = 10.0 * np.sin(2.0 * np.pi * 5.0 * time)
    offset = np.column_stack((wanted, 0.0 * wanted))
    run = simulate(ironed, np.zeros_like(offset), offset, None, substeps=50, rounded=False)
    moved = np.gradient(np.gradient(run.position[:, 0], time), time)
    rest = run.force[:, 0] - lagging(run.force[:, 0])
    assert MASS * moved[5:-5] == pytest.approx(rest[5:-5], abs=0.5)
    assert np.ptp(rest - run.force[:, 0]) > 2.5


def test_the_force_along_a_motion_is_that_before_the_loss(ironed):
    time = ironed.sync_period * np.arange(400)
    angle = 2.0 * np.pi * 5.0 * time
    course = [1e-3 * np.sin(angle), 0.0314 * np.cos(angle), -0.987 * np.sin(angle)]
    motion = tuple(np.column_stack((part, 0.0 * part)) for part in course)
    force = force_along(ironed, motion)[:, 0]
    assert force - lagging(force) == pytest.approx(MASS * course[2], abs=1e-3)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"width": (), "loss": ()}, "width: must have 1 to 100 values, has 0"),
        ({"loss": (0.5,)}, "loss: must have 2 values like width, has 1"),
        ({"width": (0.0, 1.0)}, "width: must be above 0"),
        ({"loss": (1.5, 4.0)}, "loss: changes by 0.95 N per N, at most 0.9"),
    ],
)
def test_lists_that_do_not_fit_are_refused(nominal, changed, reason):
    with pytest.raises(ValueError, match=reason):
        MotorHysteresisTable().check(IRON | changed, nominal.axes[0])
