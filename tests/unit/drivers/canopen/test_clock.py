"""The clock of a bus, and whether its frames carry times of arrival."""

import time
from types import SimpleNamespace

from drivers.canopen import Clock, MonotonicClock, stamps_of
from drivers.canopen.clock import clock_of


def test_a_bus_without_a_clock_gets_the_monotonic_clock(pair):
    clock = clock_of(pair[0])
    assert isinstance(clock, MonotonicClock)
    start = time.monotonic_ns()
    clock.sleep_until_ns(start + 5_000_000)
    assert time.monotonic_ns() >= start + 5_000_000
    clock.sleep_until_ns(start)  # past: at once


def test_a_bus_with_a_clock_provides_it(scripted):
    assert isinstance(scripted.clock, Clock)
    assert clock_of(scripted) is scripted.clock


def bus_of(module, **attributes):
    return type("Bus", (), {"__module__": module, **attributes})()


def test_time_stamps_of_another_clock_are_not_used():
    assert stamps_of(bus_of("can.interfaces.slcan")) is None
    assert stamps_of(bus_of("can.interfaces.virtual", clock=MonotonicClock())) is None
    assert stamps_of(SimpleNamespace()) is None
