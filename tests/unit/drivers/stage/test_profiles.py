"""Moves in profile position on scripted drives, and the way back to csp."""

import pytest

from drivers.drive import Control
from drivers.errors import AxisFault, ConfigurationError, LimitError


@pytest.fixture
def enabled(stage, acknowledging):
    stage.enable()
    return stage


def test_after_relative_targets_csp_gets_a_position_not_a_distance(
    enabled, scripted, acknowledging
):
    words = acknowledging()
    enabled.move_to("x", 1e-3, 0.1, 1.0, relative=True)
    ((word, distance),) = [w for w in words if w[0] & Control.NEW_SETPOINT]
    assert (bool(word & Control.RELATIVE), distance) == (True, 1_000_000)
    assert enabled.targets[0] == pytest.approx(enabled.positions[0])


@pytest.mark.parametrize(
    ("position", "velocity", "acceleration"), [(0.2, 0.1, 1.0), (0.1, 2.0, 1.0), (0.1, 0.1, 99.0)]
)
def test_outside_the_limits_nothing_is_sent(enabled, scripted, position, velocity, acceleration):
    sent = len(scripted.sent)
    with pytest.raises(LimitError, match=r"^axis x: "):
        enabled.move_to("x", position, velocity, acceleration)
    assert len(scripted.sent) == sent
    assert enabled.enabled


def test_moves_need_an_enabled_stage_and_drives_that_offer_pp(stage, scripted):
    with pytest.raises(AxisFault, match="not enabled"), stage.profile_moves(0.1, 1.0):
        pass
    stage.enable()
    scripted.drives[1].objects[0x6502, 0] = 0xA0
    stage.boot()
    stage.enable()
    with pytest.raises(ConfigurationError, match=r"^axis y: .*pp"), stage.profile_moves(0.1, 1.0):
        pass
