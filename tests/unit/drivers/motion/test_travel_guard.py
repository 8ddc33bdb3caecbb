"""The guard of a stream of forces: velocity, and whether the axis could still stop."""

from types import SimpleNamespace

import pytest

from drivers import objects as od
from drivers.errors import AxisFault
from drivers.motion.travel_guard import TravelGuard

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
