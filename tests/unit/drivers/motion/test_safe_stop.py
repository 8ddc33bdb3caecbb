"""Safe stops on a scripted bus: when they are sent, and for how long they are repeated."""

import dataclasses

import can
import pytest

from drivers.drive import State, decode
from drivers.errors import AxisFault
from drivers.stage import Stage
from tests.unit.drivers.conftest import rest

X, Y = 0, 1
QUICK_STOP = 0x02


def test_a_stop_shows_until_the_next_boot(enabled, scripted):
    said = []

    def look(drive, count):
        if drive.latched[0] & 0xF == QUICK_STOP:
            said.append(enabled.ending)

    scripted.drives[X].on_sync = look
    assert not enabled.ending
    enabled.safe_stop()
    assert said
    assert all(said)
    assert enabled.ending
    enabled.boot()
    assert not enabled.ending


def test_drives_that_have_booted_are_stopped_before_the_first_sync(stage, scripted):
    """They may have been enabled by another host: a stop is for all that may be under power."""
    for drive in scripted.drives:
        drive.state = State.OPERATION_ENABLED
    stage.safe_stop()
    assert [d.state for d in scripted.drives] == [State.SWITCH_ON_DISABLED] * 2


def test_a_stop_sends_nothing_where_no_drive_was_ever_heard(opened, scripted):
    with opened:
        before, begin = len(scripted.sent), scripted.clock.now
        assert not opened.ending
        opened.safe_stop()
        assert len(scripted.sent) == before
        assert scripted.clock.now == begin


def test_the_slowest_axis_determines_how_long_a_stop_may_take(
    scripted, bus_settings, axis_settings
):
    """1 m/s at 1 m/s^2 is 1 s, and 0.5 s to react."""
    x, y = axis_settings
    axes = (x, dataclasses.replace(y, acceleration=1.0))
    with Stage.open(bus_settings, axes, bus_object=scripted) as stage:
        stage.boot()
        stage.enable()

        def goes_on(drive, count):
            drive.state = State.OPERATION_ENABLED

        scripted.drives[X].on_sync = goes_on
        with pytest.raises(AxisFault, match=r"^axis x: .*still OPERATION ENABLED 1\.5 s after"):
            stage.quick_stop()
        scripted.drives[X].on_sync = lambda drive, count: None


@pytest.mark.parametrize("axis", [None, "z"])
def test_a_fault_without_an_axis_stops_all_and_is_raised_unchanged(enabled, scripted, axis):
    problem = AxisFault("thermal fuse", axis=axis)

    def until(position):
        raise problem

    with pytest.raises(AxisFault, match="thermal fuse") as caught:
        enabled.stream(*rest(enabled, 10), until=until)
    assert caught.value is problem
    assert [d.state for d in scripted.drives] == [State.SWITCH_ON_DISABLED] * 2


def test_a_fault_names_the_commands_before_the_stop(enabled, scripted):
    def falls_out(drive, count):
        if drive.latched[0] & 0xF == 0xF:
            drive.state = State.SWITCHED_ON

    scripted.drives[Y].on_sync = falls_out
    with pytest.raises(AxisFault, match=r"^axis y: .*left OPERATION ENABLED") as caught:
        enabled.stream(*rest(enabled, 10))
    _, _, commands = str(caught.value).partition("last commands: ")
    assert "enable operation" in commands
    assert "quick stop" not in commands
    assert caught.value.report is not None
    assert decode(caught.value.report.statusword) is State.SWITCHED_ON


def controlwords(drive):
    """What was written to 0x6040 by SDO."""
    return [value for index, _, value in drive.writes if index == 0x6040]


def test_a_stop_that_gets_through_is_one(enabled, scripted):
    begin = scripted.clock.now
    enabled.safe_stop()
    assert [d.state for d in scripted.drives] == [State.SWITCH_ON_DISABLED] * 2
    assert scripted.clock.now - begin < 50e6
    assert [controlwords(d) for d in scripted.drives] == [[], []]


@pytest.mark.parametrize("away", [0.0, 0.3, 0.55])
def test_a_bus_that_refuses_frames_is_tried_again(enabled, scripted, away):
    begin = scripted.clock.now
    scripted.broken, scripted.mended_at = can.CanOperationError("bus-off"), begin + away * 1e9
    enabled.safe_stop()
    assert [d.state for d in scripted.drives] == [State.SWITCH_ON_DISABLED] * 2
    assert scripted.clock.now - begin < (away + 0.05) * 1e9  # every 10 ms


def test_a_bus_that_stays_away_is_given_up_when_the_drives_miss_the_host(enabled, scripted):
    scripted.broken = can.CanOperationError("bus-off")
    begin = scripted.clock.now
    enabled.safe_stop()
    assert 0.6e9 <= scripted.clock.now - begin < 0.62e9


def test_a_drive_that_does_not_stop_is_told_once_by_each_word(enabled, scripted):
    """Quick stop while its process data are of no use, then both words; not again and again."""

    def goes_on(drive, count):
        drive.state = State.OPERATION_ENABLED

    x, y = scripted.drives
    x.on_sync = goes_on
    enabled.safe_stop()
    assert controlwords(x) == [QUICK_STOP, QUICK_STOP, 0]
    assert controlwords(y) == [QUICK_STOP, 0]


def test_closing_takes_force_offsets_back_before_power_off(enabled, scripted):
    position, offset = rest(enabled, 3)
    enabled.stream(position, offset + 4.0)
    offsets = []

    def look(drive, count):
        if drive.latched[0] & 0xF == 0xF:
            offsets.append(drive.latched[2])

    scripted.drives[X].on_sync = look
    enabled.close()
    assert offsets == sorted(offsets, reverse=True)
    assert len(offsets) >= 50
    assert offsets[-1] == 0
