"""Moves in profile position on scripted drives, and the way back to csp."""

import pytest

from drivers.drive import Control, Mode
from drivers.errors import AxisFault, ConfigurationError, LimitError

Words = list[tuple[int, int]]


@pytest.fixture
def enabled(stage, acknowledging):
    stage.enable()
    return stage


def test_a_move_ends_enabled_in_csp_with_the_target_held(enabled, scripted, acknowledging):
    acknowledging()
    for drive in scripted.drives:
        drive.writes.clear()
    enabled.move_to("x", 2e-3, 0.1, 1.0)
    assert [v for i, _, v in scripted.drives[0].writes if i == 0x6060] == [
        Mode.PROFILE_POSITION, Mode.CYCLIC_SYNC_POSITION,
    ]  # fmt: skip
    assert enabled.enabled
    assert enabled.targets[0] == pytest.approx(2e-3)
    assert enabled.targets[1] == pytest.approx(1.234e-6)


def test_only_the_first_of_several_targets_takes_effect_at_once(enabled, acknowledging):
    words = acknowledging()
    enabled.move_to("x", [1e-3, 2e-3, 3e-3], 0.1, 1.0)
    edges = [(word, target) for word, target in words if word & Control.NEW_SETPOINT]
    assert [target for _, target in edges] == [1_000_000, 2_000_000, 3_000_000]
    assert [bool(word & Control.CHANGE_IMMEDIATELY) for word, _ in edges] == [True, False, False]


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
