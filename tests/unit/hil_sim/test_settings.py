"""Settings of the simulator are checked when they are made; the message names the figure."""

import math
from dataclasses import replace

import pytest

from hil_sim.settings import CascadeSettings, StageSettings
from tests.unit.hil_sim.inputs import change_axes


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize(
    "name", ["mass", "increment", "velocity", "acceleration", "jerk", "following_error", "unit"]
)
def test_figures_of_an_axis_are_positive_and_finite(nominal, name, value):
    with pytest.raises(ValueError, match=f"^{name}: must be > 0"):
        replace(nominal.axes[0], **{name: value})


@pytest.mark.parametrize("name", ["noise", "wander"])
def test_noise_may_be_zero_but_not_less(nominal, name):
    replace(nominal.axes[0], **{name: 0.0})
    with pytest.raises(ValueError, match=f"^{name}: must be >= 0"):
        replace(nominal.axes[0], **{name: -1e-12})


@pytest.mark.parametrize("node", [0, 128])
def test_a_node_id_is_one_of_canopen(nominal, node):
    with pytest.raises(ValueError, match=r"^node: must be 1\.\.127"):
        replace(nominal.axes[0], node=node)


def test_a_travel_has_a_length(nominal):
    with pytest.raises(ValueError, match=r"^travel: "):
        replace(nominal.axes[0], travel=(0.1, 0.1))


def test_control_periods_are_one_and_divide_the_sync_period(nominal):
    x, y = nominal.axes
    slower = replace(y, control=replace(y.control, period=2e-4))
    with pytest.raises(ValueError, match=r"^control_period: must be the same on all axes"):
        StageSettings(1e-3, (x, slower))
    with pytest.raises(ValueError, match=r"^control_period: must divide sync_period"):
        StageSettings(1.05e-3, (x, y))
    with pytest.raises(ValueError, match=r"^axes: at least one"):
        StageSettings(1e-3, ())


def test_ticks_and_steps_follow_from_the_periods(nominal):
    assert (nominal.ticks, nominal.quick_substeps) == (10, 1)
    slow = change_axes(nominal, control={"period": 5e-4})
    assert (slow.ticks, slow.quick_substeps) == (2, 5)  # a coarse step would miss stick-slip


@pytest.mark.parametrize("span", [0, 3])
def test_a_cascade_differences_over_one_or_two_ticks(span):
    with pytest.raises(ValueError, match=r"^span: must be one of 1, 2, is"):
        CascadeSettings(1.0, 1.0, span=span)
