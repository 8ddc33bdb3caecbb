"""Virtual time that keeps to the wall clock."""

import time

import pytest

from hil_sim.bus import PacedWorld, paced_world


@pytest.fixture
def clock(monkeypatch):
    """A clock of the test's, on which `sleep` takes a little longer than asked for."""
    now = [0]

    def sleep(seconds):
        now[0] += round(seconds * 1e9) + 1000

    monkeypatch.setattr(paced_world.time, "monotonic_ns", lambda: now[0])
    monkeypatch.setattr(paced_world.time, "sleep", sleep)
    return now


def test_no_instant_comes_before_its_time(clock):
    world, seen = PacedWorld("paced"), []
    for at in (3_000_000, 1_000_000):
        world.at(at, lambda: seen.append((world.now_ns, clock[0])))
    world.sleep_until_ns(5_000_000)
    assert [virtual for virtual, _ in seen] == [1_000_000, 3_000_000]
    assert all(0 <= real - virtual < 10_000 for virtual, real in seen)
    assert world.now_ns == 5_000_000
    assert world.late == 0


def test_a_short_delay_is_made_up_for_and_counted(clock):
    world = PacedWorld("paced")
    world.sleep_until_ns(1_000_000)
    clock[0] += 5_000_000  # the host computes for five periods
    for _ in range(4):
        world.sleep_until_ns(world.now_ns + 1_000_000)
    assert clock[0] == pytest.approx(6_000_000, abs=10_000)  # nothing was waited for
    assert world.late == 4
    assert max(world.turnarounds) == pytest.approx(5_000_000, abs=10_000)


def test_virtual_time_stands_still_for_a_long_delay(clock):
    world = PacedWorld("paced")
    clock[0] += 10_000_000_000
    world.sleep_until_ns(1_000_000)
    before = clock[0]
    world.sleep_until_ns(200_000_000)
    assert clock[0] - before == pytest.approx(149_000_000, abs=1_000_000)


def test_a_cancelled_timer_is_not_waited_for(clock):
    world = PacedWorld("paced")
    world.at(1_000_000_000, lambda: None).cancel()
    world.sleep_until_ns(2_000_000)
    assert clock[0] < 3_000_000


def test_it_keeps_to_the_real_clock():
    world, begin = PacedWorld("paced"), time.monotonic()
    world.sleep_until_ns(20_000_000)
    assert time.monotonic() - begin >= 0.02
