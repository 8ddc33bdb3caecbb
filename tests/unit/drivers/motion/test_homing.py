"""Homing: how its statuswords are judged, and how it ends."""

import pytest

from drivers.drive import State
from drivers.errors import HomingError
from drivers.motion.homing import Progress, homing_timeout, next_progress
from tests.unit.drivers.conftest import power_is_off

X, Y = 0, 1

# statusword bits 13, 12, 10 of CiA 402-2, homing mode
IN_PROGRESS, INTERRUPTED, ATTAINED, DONE = 0x0237, 0x0637, 0x1237, 0x1637
ERROR_MOVING, ERROR_STOPPED = 0x2237, 0x2637


@pytest.mark.parametrize(
    ("word", "before", "elapsed", "after"),
    [
        (INTERRUPTED, Progress.WAITING, 0.0, Progress.WAITING),  # not begun yet looks the same
        (IN_PROGRESS, Progress.WAITING, 0.0, Progress.RUNNING),
        (IN_PROGRESS, Progress.RUNNING, 1.0, Progress.RUNNING),
        (INTERRUPTED, Progress.RUNNING, 1.0, Progress.INTERRUPTED),
        (ATTAINED, Progress.RUNNING, 1.0, Progress.RUNNING),  # still moving: not done
        (DONE, Progress.RUNNING, 1.0, Progress.DONE),
        (DONE, Progress.WAITING, 0.001, Progress.WAITING),  # of an earlier homing
        (DONE, Progress.WAITING, 0.1, Progress.DONE),  # a drive that is done at once
        (ERROR_MOVING, Progress.RUNNING, 1.0, Progress.FAILED),
        (ERROR_STOPPED, Progress.WAITING, 0.0, Progress.FAILED),
    ],
)
def test_progress_follows_the_statusword(word, before, elapsed, after):
    assert next_progress(word, before, elapsed) is after


def test_the_timeout_covers_the_travel_both_ways(axis_settings):
    assert homing_timeout(axis_settings[0]) > 2 * 0.3 / 0.002


def _homing(outcome):
    """A drive's statusword bits 13, 12, 10 from the SYNC of the start bit on."""
    steps = []

    def on_sync(drive, count):
        if drive.state is State.OPERATION_ENABLED and drive.objects.get((0x6060, 0)) == 6:
            started = drive.controlword & 0x10
            steps.extend(outcome if started and not steps else [])
            drive.bits = (steps.pop(0) if len(steps) > 1 else steps[0]) if steps else 0x400

    return on_sync


def test_homing_ends_when_attained_and_reached_and_is_not_repeated(stage, scripted):
    for drive in scripted.drives:
        drive.on_sync = _homing([0x400, 0, 0, 0x1000, 0x1000, 0x1400])
    stage.home()
    assert stage.homed
    before = len(scripted.sent)
    stage.home()
    assert len(scripted.sent) == before


@pytest.mark.parametrize(
    ("outcome", "text"),
    [
        ([0, 0, 0x400], r"interrupted"),
        ([0, 0x2400], r"homing error"),
        ([0x400], r"did not start within 0.5 s"),
    ],
)
def test_homing_failures_are_distinguished(stage, scripted, outcome, text):
    scripted.drives[X].on_sync = _homing([0x400, 0, 0x1400])
    scripted.drives[Y].on_sync = _homing(outcome)
    with pytest.raises(
        HomingError, match=r"^axis y: 0x6098:00 homing method: method 34: .*" + text
    ):
        stage.home()
    assert not stage.homed
    assert power_is_off(scripted)


@pytest.mark.parametrize("refusing", [X, Y])
def test_a_mode_that_is_refused_under_power_is_set_without(stage, scripted, refusing):
    """0x08000022: not in this state of the device."""
    mode, modes_under_power = (0x6060, 0), []

    def reluctant(homing):
        def on_sync(drive, count):
            drive.refuse.pop(mode, None)
            if drive.state is State.OPERATION_ENABLED:
                drive.refuse[mode] = 0x08000022
                modes_under_power.append(drive.objects[mode])
            homing(drive, count)

        return on_sync

    for axis, drive in enumerate(scripted.drives):
        homing = _homing([0x400, 0, 0x1400])
        drive.on_sync = reluctant(homing) if axis == refusing else homing
    stage.enable()
    stage.home()
    assert stage.homed
    assert list(dict.fromkeys(modes_under_power)) == [8, 6]
