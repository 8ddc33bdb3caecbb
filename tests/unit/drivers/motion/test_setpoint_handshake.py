"""The setpoint handshake on scripted drives: the order of bits, and drives that leave some out."""

import pytest

from drivers.drive import Control, State
from drivers.errors import AxisFault

ENABLED, NOW, NEW = 0x0F, int(Control.CHANGE_IMMEDIATELY), int(Control.NEW_SETPOINT)
START = 1234


def test_the_target_and_bit_5_are_there_before_bit_4_rises(enabled, acknowledging):
    words = acknowledging()
    enabled.move_to("x", 1e-3, 0.1, 1.0)
    first = words.index((ENABLED | NOW, 1_000_000))
    assert words[first : first + 3] == [
        (ENABLED | NOW, 1_000_000),
        (ENABLED | NOW | NEW, 1_000_000),
        (ENABLED | NOW, 1_000_000),
    ]


def test_a_drive_that_moves_without_acknowledging_is_a_limitation(enabled, scripted):
    def on_sync(drive, count):
        drive.bits = 1 << 10

    for drive in scripted.drives:
        drive.on_sync = on_sync
    enabled.move_to("x", 1e-3, 0.1, 1.0)
    assert enabled.positions[0] == pytest.approx(1e-3)
    assert [t for t in enabled.limitations if "bit 12" in t] == [
        "axis x: statusword bit 12 in pp is not offered: setpoints are not acknowledged"
    ]


def test_a_drive_that_neither_acknowledges_nor_moves_has_not_taken_the_target(enabled, stuck):
    stuck()
    with pytest.raises(
        AxisFault,
        match=r"^axis x: 0x607A:00 target position: the drive did not acknowledge setpoint 1000000 "
        r"within 0\.5 s \(statusword 0x0227\)",
    ):
        enabled.move_to("x", 1e-3, 0.1, 1.0)
    assert not enabled.enabled


def test_a_drive_that_keeps_bit_12_is_not_ready_for_a_target(enabled, scripted):
    def on_sync(drive, count):
        drive.bits = 1 << 12

    scripted.drives[0].on_sync = on_sync
    with pytest.raises(AxisFault, match=r"^axis x: .*the drive is not ready for setpoint 1000000"):
        enabled.move_to("x", 1e-3, 0.1, 1.0)


def test_a_target_that_is_acknowledged_and_not_reached_in_time(enabled, scripted):
    def on_sync(drive, count):
        word, _, offset = drive.latched
        drive.bits = 1 << 12 if word & NEW else 0
        drive.latched = (word, START, offset)

    scripted.drives[0].on_sync = on_sync
    with pytest.raises(AxisFault, match=r"did not reach setpoint 1000000 within 2\.\d+ s"):
        enabled.move_to("x", 1e-3, 0.1, 1.0)


def test_bit_10_of_the_previous_target_does_not_count(enabled, scripted):
    """Set all along, it counts only once the axis is at its target."""
    seen = []

    def on_sync(drive, count):
        word, target, offset = drive.latched
        drive.bits = 1 << 12 if word & NEW else 1 << 10
        if target == 1_000_000 and drive.position != target and len(seen) < 300:
            seen.append(drive.position)
            drive.latched = (word, drive.position, offset)

    scripted.drives[0].on_sync = on_sync
    enabled.move_to("x", 1e-3, 0.1, 1.0)
    assert len(seen) == 300
    assert enabled.positions[0] == pytest.approx(1e-3)


def test_a_fault_meanwhile_is_named(enabled, scripted):
    def on_sync(drive, count):
        if drive.latched[0] & NEW:
            drive.state = State.SWITCH_ON_DISABLED

    scripted.drives[0].on_sync = on_sync
    with pytest.raises(AxisFault, match=r"^axis x: .*stopped during a profile move"):
        enabled.move_to("x", 1e-3, 0.1, 1.0)
