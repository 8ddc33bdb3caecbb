"""Streams in csp on scripted drives, and the guard of a stream of forces."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from drivers import objects as od
from drivers.drive import Mode
from drivers.errors import AxisFault
from drivers.motion.cyclic_modes import TravelGuard
from drivers.stage import Stage
from tests.unit.drivers.conftest import rest


def test_a_stream_needs_an_enabled_stage(stage, scripted):
    sent = len(scripted.sent)
    with pytest.raises(AxisFault, match="not enabled"):
        stage.stream(*rest(stage, 3))
    assert not [f for f in scripted.sent[sent:] if f[1] == 0x080]


def test_a_stream_in_another_mode_is_refused(opened, scripted):
    for drive in scripted.drives:
        drive.objects[0x6502, 0] = 0x1A1 | 0x200  # with csv and cst
    with opened:
        opened.boot()
        opened.enable()
        opened.stream_velocity(np.zeros((2, 2)))
        with pytest.raises(AxisFault, match=r"^axis x: the stage is not in csp: enable it first"):
            opened.stream(*rest(opened, 3))
        opened.enable()
        assert len(opened.stream(*rest(opened, 3))) == 3


def test_enabling_an_enabled_stage_changes_no_mode(enabled, scripted):
    for drive in scripted.drives:
        drive.writes.clear()
    enabled.enable()
    assert all(not drive.writes for drive in scripted.drives)
    assert all(drive.objects[0x6060, 0] == Mode.CYCLIC_SYNC_POSITION for drive in scripted.drives)


def test_samples_are_in_the_units_of_each_axis(scripted, bus_settings, axis_settings):
    coarse = dataclasses.replace(axis_settings[1], increment=1e-8, velocity_unit=1e-9)
    scripted.drives[1].objects[0x60A8, 0] = 0xF8010000
    with Stage.open(bus_settings, (axis_settings[0], coarse), bus_object=scripted) as stage:
        stage.boot()
        stage.enable()
        samples = stage.stream(*rest(stage, 2))
    np.testing.assert_allclose(samples.position[-1], (1.234e-6, 1.234e-5))


SETTINGS = SimpleNamespace(name="x", velocity=0.5, acceleration=2.0, travel=(-0.1, 0.1))
CHANNEL = SimpleNamespace(axis=SimpleNamespace(settings=SETTINGS))


class SyncClock:
    """One millisecond later at every look."""

    time_ns = 0

    def now_ns(self):
        self.time_ns += 1_000_000
        return self.time_ns


def slide(start, speed, count=8, until=None):
    """Feed an axis at constant speed through the guard; its answers."""
    guard = TravelGuard([CHANNEL], SyncClock(), until)
    return [guard((start + speed * k * 1e-3,)) for k in range(count)]


def test_slow_motion_in_the_middle_passes():
    assert slide(0.0, 0.4) == [False] * 8


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_too_fast_either_way_is_a_fault_of_the_force(way):
    with pytest.raises(AxisFault, match="velocity limit") as caught:
        slide(0.0, way * 0.51)
    assert caught.value.object == od.TARGET_FORCE


@pytest.mark.parametrize(("way", "limit"), [(1.0, od.SOFT_LIMIT_HIGH), (-1.0, od.SOFT_LIMIT_LOW)])
def test_an_axis_that_could_not_stop_before_the_limit_is_a_fault(way, limit):
    # At 0.4 m/s it needs 4 mm until the drive brakes and 40 mm to brake.
    stopping = 0.4 * 0.01 + 0.4**2 / (2 * 2.0)
    at_check = 0.4 * 7e-3  # slid until the last look
    assert not any(slide(way * (0.1 - stopping - at_check - 1e-4), way * 0.4))
    with pytest.raises(AxisFault, match="may not stop before the limit") as caught:
        slide(way * (0.1 - stopping - at_check + 1e-4), way * 0.4)
    assert caught.value.object == limit


def test_moving_away_from_a_near_limit_passes():
    assert slide(0.0999, -0.3) == [False] * 8


def test_the_applications_own_condition_ends_the_stream():
    assert slide(0.0, 0.1, until=lambda positions: positions[0] > 4.5e-4)[4:6] == [False, True]
