"""Who moves the demand: SYNC or the profile generator, on a hand-wound clock."""

import pytest

from hil_sim.cia402.demand import TICK_NS, DemandSource


class HandClock:
    """A segment with timers that run when the clock is wound to them."""

    def __init__(self):
        self.now_ns = 0
        self.timers = []

    def at(self, time_ns, action):
        timer = HandTimer(time_ns, action)
        self.timers.append(timer)
        return timer

    def wind_to(self, time_ns, late_ns=0):
        """Run what is due until then, each timer `late_ns` after its time."""
        while due := [t for t in self.timers if not t.cancelled and t.time_ns <= time_ns]:
            timer = min(due, key=lambda t: t.time_ns)
            self.timers.remove(timer)
            self.now_ns = timer.time_ns + late_ns
            timer.action()
        self.now_ns = time_ns


class HandTimer:
    def __init__(self, time_ns, action):
        self.time_ns, self.action, self.cancelled = time_ns, action, False

    def cancel(self):
        self.cancelled = True


class IdealMotor:
    tick_ns = 100_000

    def __init__(self):
        self.commands = []

    def demand(self):
        return self.commands[-1][0] if self.commands else 0.0

    def command_true(self, position, ticks):
        self.commands.append((position, ticks))


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def motor():
    return IdealMotor()


@pytest.fixture
def demand(clock, motor):
    source = DemandSource(motor, clock, lambda time_ns: None, lambda: source.step())
    return source


def test_the_generator_steps_every_period_under_power_only(demand, clock, motor):
    demand.generator.move(1e-3, 0.1, 1.0, 1.0)
    clock.wind_to(5 * TICK_NS)
    assert motor.commands == []
    demand.select(powered=True, following=False)
    clock.wind_to(10 * TICK_NS)
    assert [ticks for _, ticks in motor.commands] == [TICK_NS // motor.tick_ns] * 5
    demand.select(powered=False, following=False)
    clock.wind_to(20 * TICK_NS)
    assert len(motor.commands) == 5


def test_sync_takes_the_demand_and_leaving_it_commands_at_once(demand, clock, motor):
    demand.select(powered=True, following=True)
    clock.wind_to(5 * TICK_NS)
    assert motor.commands == []
    demand.select(powered=True, following=False)
    assert len(motor.commands) == 1


@pytest.mark.parametrize("late", [0, 1, 3])
def test_a_profile_keeps_its_time_on_a_late_clock(demand, clock, motor, late):
    punctual = DemandSource(IdealMotor(), HandClock(), lambda time_ns: None, lambda: None).generator
    for generator in (demand.generator, punctual):
        generator.move(1e-3, 0.1, 1.0, 1.0)
    demand.select(powered=True, following=False)
    clock.wind_to(TICK_NS, late_ns=late * TICK_NS)
    for _ in range(late):
        punctual.step()
    assert motor.commands[-1][0] == punctual.step()


def test_a_profile_that_ends_in_periods_passed_over_is_commanded_to_its_end(demand, clock, motor):
    demand.generator.move(1e-6, 0.1, 1.0, 1.0)
    demand.select(powered=True, following=False)
    clock.wind_to(TICK_NS, late_ns=1000 * TICK_NS)
    assert motor.commands[-1][0] == pytest.approx(1e-6)


def test_a_stop_ends_once_and_an_abandoned_one_never(demand):
    ended = []
    demand.take_over(1e-3)
    demand.stop(1.0, lambda: ended.append(True))
    demand.end_stop()
    assert demand.stopping
    assert not ended
    while not demand.generator.done:
        demand.step()
    demand.end_stop()
    demand.end_stop()
    assert ended == [True]
    demand.stop(1.0, lambda: ended.append(True))
    demand.abandon_stop()
    assert not demand.stopping
    demand.end_stop()
    assert ended == [True]
