"""Fault resets on a scripted bus: those that succeed and those that do not."""

import pytest

from drivers.drive import State
from drivers.errors import AxisFault
from tests.unit.drivers.conftest import rest

X, Y = 0, 1
RESET, HALT = 0x0080, 0x0100
QUICK_STOP, DISABLE_VOLTAGE = 0x02, 0x00
CONTROLWORD, HEARTBEAT = 0x6040, 0x77F


@pytest.mark.parametrize("axis", [X, Y])
def test_an_axis_that_does_not_come_to_power_is_named(stage, scripted, axis):
    def stays_behind(drive, count):
        if drive.state is State.SWITCHED_ON:
            drive.state = State.READY_TO_SWITCH_ON

    scripted.drives[axis].on_sync = stays_behind
    begin = scripted.clock.now
    text = (
        rf"^axis {'xy'[axis]}: .*does not reach OPERATION ENABLED within 2 s "
        r"\(enable_timeout\); statusword 0x"
    )
    with pytest.raises(AxisFault, match=text):
        stage.enable()
    assert scripted.clock.now - begin > 2e9
    assert State.OPERATION_ENABLED not in [d.state for d in scripted.drives]


@pytest.mark.parametrize("axis", [X, Y])
def test_an_axis_that_sends_nothing_does_not_come_to_power(stage, scripted, axis):
    scripted.drives[axis].mute_tpdo = 1_000_000
    with pytest.raises(AxisFault, match=rf"^axis {'xy'[axis]}: .*no process data"):
        stage.enable()
    assert scripted.drives[1 - axis].state is State.SWITCH_ON_DISABLED


def test_a_quick_stop_takes_the_force_offsets_away(enabled, scripted):
    position, offset = rest(enabled, 3)
    enabled.stream(position, offset + 4.0)
    offsets = []

    def look(drive, count):
        if drive.latched[0] == QUICK_STOP:
            offsets.append(drive.latched[2])

    scripted.drives[Y].on_sync = look
    enabled.quick_stop()
    assert offsets
    assert set(offsets) == {0}


def in_fault(scripted):
    """Axis y in fault."""
    drive = scripted.drives[Y]
    drive.state = State.FAULT
    return drive


def test_a_reset_without_a_fault_takes_a_few_syncs(stage, scripted):
    begin = scripted.clock.now
    stage.reset_faults()
    assert scripted.clock.now - begin < 500e6
    assert {d.latched[0] & RESET for d in scripted.drives} == {0}


@pytest.mark.parametrize("at_once", [True, False])
def test_a_fault_reset_clears_its_bit(stage, scripted, at_once):
    """Whether the drive shows its new state at the same SYNC or at the next one."""
    drive = in_fault(scripted)

    def takes_it_at_once(d, count):
        if at_once and d.latched[0] & RESET:
            d.state = State.SWITCH_ON_DISABLED

    drive.on_sync = takes_it_at_once
    begin = scripted.clock.now
    stage.reset_faults()
    assert scripted.clock.now - begin < 500e6
    assert drive.state is State.SWITCH_ON_DISABLED
    assert drive.latched[0] & RESET == 0
    stage.enable()


def test_a_fault_that_recurs_is_reset_by_another_edge(stage, scripted):
    drive = in_fault(scripted)

    def again(d, count):
        if count - begin < 10:
            d.state = State.FAULT

    begin, drive.on_sync = drive.syncs, again
    stage.reset_faults()
    assert drive.state is State.SWITCH_ON_DISABLED


def test_emergencies_during_a_fault_reset_are_cleared(stage, scripted):
    drive = in_fault(scripted)
    drive.on_sync = lambda d, n: d.emergency(0x3210) if d.state is State.FAULT else None
    stage.reset_faults()
    stage.enable()
    assert stage.enabled


def test_a_fault_that_stays_is_named_with_its_cause(stage, scripted):
    drive = in_fault(scripted)

    def stays(d, count):
        d.state = State.FAULT
        d.emergency(0x3210)

    drive.on_sync = stays
    text = (
        r"^axis y: 0x6041:00 statusword: the fault cannot be reset; .*"
        r"DC link over-voltage \(0x3210\).*\(FAULT\)"
    )
    with pytest.raises(AxisFault, match=text) as caught:
        stage.reset_faults()
    assert caught.value.code == 0x3210


def test_a_silent_axis_is_named_and_the_other_one_is_reset(stage, scripted):
    scripted.drives[X].mute_tpdo = 1_000_000
    drive = in_fault(scripted)
    with pytest.raises(
        AxisFault, match=r"^axis x: 0x6041:00 statusword: no process data \(TPDO 0x181\) at all"
    ):
        stage.reset_faults()
    assert drive.state is State.SWITCH_ON_DISABLED


def test_an_axis_that_answers_late_is_waited_for(stage, scripted):
    scripted.drives[Y].mute_tpdo = 100
    drive = in_fault(scripted)
    stage.reset_faults()
    assert drive.syncs > 100
    assert drive.state is State.SWITCH_ON_DISABLED


def test_an_emergency_does_not_break_off_a_quick_stop(enabled, scripted):
    words = []

    def shouts(drive, count):
        words.append(drive.latched[0])
        if drive.latched[0] == QUICK_STOP:
            drive.emergency(0x2310)

    scripted.drives[Y].on_sync = shouts
    enabled.quick_stop()
    assert words[-1] == DISABLE_VOLTAGE
    assert [d.state for d in scripted.drives] == [State.SWITCH_ON_DISABLED] * 2


def test_power_stays_on_while_a_quick_stop_brakes(enabled, scripted):
    """Drives with option codes 5 to 8 stay in QUICK STOP ACTIVE: standing still is the end."""
    moving = []

    def brakes(drive, count):
        if drive.state is State.QUICK_STOP_ACTIVE and len(moving) < 250:
            moving.append(drive.latched[0])
            drive.position += 1000

    scripted.drives[Y].on_sync = brakes
    first = len(scripted.sent)
    enabled.quick_stop()
    assert len(moving) == 250
    assert set(moving) == {QUICK_STOP}
    assert scripted.drives[Y].state is State.SWITCH_ON_DISABLED
    beats = [t for t, can_id, _ in scripted.sent[first:] if can_id == HEARTBEAT]
    assert len(beats) >= 2  # they obey, so they need not lose our heartbeat


def test_an_axis_that_goes_on_is_told_by_sdo_and_then_misses_the_host(enabled, scripted):
    x, y = scripted.drives
    begin, first = scripted.clock.now, len(scripted.sent)

    def goes_on(drive, count):
        if scripted.clock.now < begin + 500_000_000:
            drive.state = State.OPERATION_ENABLED

    x.on_sync = goes_on
    x.writes.clear()
    y.writes.clear()
    enabled.quick_stop()
    asked = [t for t, i, d in scripted.sent[first:] if i == 0x601 and d[1:3] == b"\x40\x60"]
    assert x.writes[0] == (CONTROLWORD, 0, QUICK_STOP)
    assert len([w for w in x.writes if w[2] == QUICK_STOP]) == 1
    assert begin + 15e6 < asked[0] < begin + 40e6
    assert y.writes == []
    beats = [t - begin for t, can_id, _ in scripted.sent[first:] if can_id == HEARTBEAT]
    assert [t for t in beats if 40e6 < t < 500e6] == []
    assert x.state is State.SWITCH_ON_DISABLED
    begin, first = scripted.clock.now, len(scripted.sent)
    enabled.idle(0.35)
    assert len([i for _, i, _ in scripted.sent[first:] if i == HEARTBEAT]) >= 3


def test_a_silent_axis_is_given_the_time_to_miss_the_host(enabled, scripted):
    """And the other one, which stands still in QUICK STOP ACTIVE, is not blamed for it."""
    scripted.drives[X].mute_tpdo = 1_000_000
    begin = scripted.clock.now
    stops = []

    def look(drive, count):
        if drive.latched[0] == QUICK_STOP:
            stops.append(scripted.clock.now)

    scripted.drives[Y].on_sync = look
    enabled.quick_stop()
    assert stops[-1] - begin >= 0.59e9
    assert scripted.drives[Y].state is State.SWITCH_ON_DISABLED


def test_an_emergency_on_the_way_to_power_ends_it(stage, scripted):
    """Also where the drive goes on as if nothing had been."""
    drive = scripted.drives[Y]

    def shouts(d, count):
        if d.state is State.SWITCHED_ON:
            d.emergency(0x3210)

    drive.on_sync = shouts
    with pytest.raises(AxisFault, match=r"^axis y: .*DC link over-voltage \(0x3210\)"):
        stage.enable()
    assert not stage.enabled
    assert [d.state for d in scripted.drives] == [State.SWITCH_ON_DISABLED] * 2


def test_a_drive_that_refuses_a_word_by_sdo_does_not_keep_it_from_the_other(enabled, scripted):
    def goes_on(drive, count):
        drive.state = State.OPERATION_ENABLED

    for drive in scripted.drives:
        drive.on_sync = goes_on
    scripted.drives[X].refuse[CONTROLWORD, 0] = 0x08000022
    enabled.safe_stop()
    words = [value for index, _, value in scripted.drives[Y].writes if index == CONTROLWORD]
    assert words == [QUICK_STOP, QUICK_STOP, DISABLE_VOLTAGE]
