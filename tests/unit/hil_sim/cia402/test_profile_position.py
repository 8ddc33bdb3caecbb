"""pp: the set-point handshake and what the demand does meanwhile."""

import numpy as np
import pytest

ACKNOWLEDGE, REACHED, LIMIT = 0x1000, 0x0400, 0x0800
START = 2.5e-3


@pytest.fixture
def pp(host):
    host.write(1, 0x6081, 0, "I", 20_000_000)  # 20 mm/s
    host.write(1, 0x6083, 0, "I", 1_000_000)  # 1 m/s^2
    host.write(1, 0x6084, 0, "I", 1_000_000)
    host.write(1, 0x60A4, 1, "I", 100_000_000)  # 100 m/s^3
    host.enable(1)
    return host


def setpoint(host, target, bits=0):
    """The handshake as a master does it; True when the drive took the set-point."""
    host.write(1, 0x607A, 0, "i", target)
    taken = host.control(0x1F | bits) & ACKNOWLEDGE
    host.control(0x0F)
    return bool(taken)


def test_profile_keeps_speed_acceleration_and_jerk(pp, plant):
    plant.commands.clear()
    setpoint(pp, 2_000_000)
    pp.wait(300)
    path = np.array([START] * 4 + [c[2] for c in plant.commands])
    velocity = np.diff(path) / 1e-3
    acceleration = np.diff(velocity) / 1e-3
    jerk = np.diff(acceleration) / 1e-3
    assert path[-1] == pytest.approx(START + 2e-3, abs=1e-12)
    assert velocity.max() == pytest.approx(20e-3, rel=1e-6)
    assert np.abs(acceleration).max() <= 1.0 + 1e-6
    assert np.abs(jerk).max() <= 100.0 * (1 + 1e-3)
    assert (velocity > -1e-12).all()


def test_second_setpoint_waits_for_the_first(pp, plant):
    assert setpoint(pp, 500_000)
    assert setpoint(pp, -500_000)
    assert pp.statusword() & ACKNOWLEDGE  # no room for a third
    pp.write(1, 0x607A, 0, "i", 999_000)
    pp.control(0x1F)
    pp.control(0x0F)
    pp.wait(400)
    assert max(c[2] for c in plant.commands) == pytest.approx(START + 0.5e-3, abs=1e-12)
    assert pp.read_object(1, 0x6064, 0, "i") == -500_000
    assert pp.statusword() & (REACHED | ACKNOWLEDGE) == REACHED


def speeds(plant):
    """Of the demand of axis 0 [m/s], millisecond by millisecond."""
    return np.diff([c[2] for c in plant.commands if c[1] == 0]) / 1e-3


@pytest.mark.parametrize(("then", "bits"), [(-500_000, 0x200), (2_000_000, 0)])
def test_a_target_is_stopped_at_where_the_next_lies_back_or_bit_9_is_not_set(pp, plant, then, bits):
    plant.commands.clear()
    setpoint(pp, 1_000_000)
    pp.wait(20)
    setpoint(pp, then, bits=bits)
    pp.wait(400)
    assert pp.read_object(1, 0x6064, 0, "i") == then
    path = np.array([c[2] for c in plant.commands if c[1] == 0]) - START
    turn = np.flatnonzero(np.isclose(path, 1e-3, rtol=0, atol=1e-12))
    assert len(turn) > 0
    assert speeds(plant)[turn[0] - 2] < 1e-3  # braked
    assert path[: turn[0]].max() < 1e-3


def test_a_halt_on_the_way_past_a_target_goes_on_past_it(pp, plant):
    setpoint(pp, 1_000_000)
    pp.wait(20)
    setpoint(pp, 2_000_000, bits=0x200)
    pp.control(0x10F)
    pp.wait(60)
    plant.commands.clear()
    pp.control(0x0F)
    pp.wait(300)
    assert pp.read_object(1, 0x6064, 0, "i") == 2_000_000
    path = np.array([c[2] for c in plant.commands if c[1] == 0]) - START
    at_first = speeds(plant)[np.searchsorted(path, 1e-3) - 1]
    assert at_first > 15e-3


def test_target_beyond_the_soft_limit(pp):
    pp.write(1, 0x607D, 2, "i", 400_000)
    setpoint(pp, 900_000)
    pp.wait(300)
    assert pp.statusword() & LIMIT
    assert pp.read_object(1, 0x6064, 0, "i") == 400_000
    setpoint(pp, 100_000)
    assert not pp.statusword() & LIMIT


def test_halt_stops_with_bit_10_and_goes_on(pp):
    setpoint(pp, 3_000_000)
    pp.wait(50)
    pp.control(0x10F)
    pp.wait(100)
    assert pp.statusword() & REACHED  # velocity is 0
    stopped = pp.read_object(1, 0x6064, 0, "i")
    assert 0 < stopped < 2_900_000
    pp.control(0x0F)
    assert not pp.statusword() & REACHED
    pp.wait(400)
    assert pp.read_object(1, 0x6064, 0, "i") == 3_000_000


def test_a_blocked_axis_never_reports_target_reached(pp, plant):
    plant.blocked[0] = True
    setpoint(pp, 100_000)
    pp.wait(300)
    assert not pp.statusword() & REACHED
    assert pp.statusword() & 0x6F == 0x27  # 0.1 mm is inside the following error window


def test_force_offset_is_ignored(pp, plant):
    plant.commands.clear()
    pp.write(1, 0x60B2, 0, "h", 200)
    setpoint(pp, 100_000)
    pp.wait(50)
    assert plant.commands
    assert {c[3] for c in plant.commands} == {0.0}


def test_changing_to_pp_in_motion_brakes(host, plant):
    host.write(1, 0x6060, 0, "b", 8)
    host.write(1, 0x6084, 0, "I", 1_000_000)
    host.nmt(1)
    for word in (0x06, 0x07, 0x0F):
        host.cycle(0, word=word)
    for k in range(10):
        host.cycle(k * 10_000, force=30)
    host.write(1, 0x6060, 0, "b", 1)
    host.wait(50)
    assert plant.actual[0] == pytest.approx(START + 90e-6 + 50e-6, abs=1e-9)
    assert plant.offset[0] == 0.0
