"""Profile velocity and cyclic synchronous velocity on a plant that follows its demand exactly."""

import struct

import pytest

from hil_sim.cia402.modes import INTERNAL_LIMIT, MODE_BIT_12, TARGET_REACHED


class Moving:
    """The following plant, with the velocity that its positions have."""

    def __init__(self, plant):
        self.plant = plant
        self.last = (plant.time_ns, plant.actual[0])
        self.speed = 0.0

    def velocity(self, axis):
        now, x = self.plant.time_ns, self.plant.actual[0]
        if now > self.last[0]:
            self.speed = (x - self.last[1]) / ((now - self.last[0]) * 1e-9)
            self.last = (now, x)
        return self.speed


@pytest.fixture
def pv(host, plant):
    plant.velocity = Moving(plant).velocity
    host.write(1, 0x6083, 0, "I", 1_000_000)  # 1 m/s^2
    host.write(1, 0x6084, 0, "I", 2_000_000)
    host.enable(3)
    return host


def test_pv_ramps_cruises_and_stops(pv, plant):
    pv.write(1, 0x60FF, 0, "i", 20_000_000)  # 20 mm/s: 20 ms up, 10 ms down
    pv.wait(10)
    assert not pv.statusword() & TARGET_REACHED
    pv.wait(40)
    assert pv.statusword() & (TARGET_REACHED | MODE_BIT_12) == TARGET_REACHED
    before = plant.actual[0]
    pv.wait(100)
    assert plant.actual[0] - before == pytest.approx(2e-3, rel=0.02)
    pv.write(1, 0x60FF, 0, "i", -20_000_000)
    pv.wait(100)
    assert plant.velocity(0) == pytest.approx(-0.02, rel=1e-6)
    pv.write(1, 0x60FF, 0, "i", 0)
    pv.wait(50)
    assert pv.statusword() & (TARGET_REACHED | MODE_BIT_12) == TARGET_REACHED | MODE_BIT_12


def test_pv_halts_and_goes_on(pv, plant):
    pv.write(1, 0x60FF, 0, "i", 20_000_000)
    pv.wait(50)
    pv.control(0x10F)
    pv.wait(50)
    assert pv.statusword() & (TARGET_REACHED | MODE_BIT_12) == TARGET_REACHED | MODE_BIT_12
    pv.control(0x0F)
    pv.wait(50)
    assert plant.velocity(0) == pytest.approx(0.02, rel=1e-6)


def test_pv_comes_to_rest_at_the_soft_limit(pv, plant):
    origin = plant.actual[0] * 1e9 - pv.read_object(1, 0x6064, 0, "i")
    pv.write(1, 0x607D, 2, "i", 3_000_000)
    pv.write(1, 0x60FF, 0, "i", 100_000_000)
    pv.wait(300)
    assert pv.statusword() & INTERNAL_LIMIT
    assert plant.actual[0] * 1e9 - origin == pytest.approx(3_000_000, abs=1)
    pv.write(1, 0x60FF, 0, "i", -10_000_000)
    pv.wait(100)
    assert plant.actual[0] * 1e9 - origin < 2_500_000
    assert not pv.statusword() & INTERNAL_LIMIT


def test_quick_stop_in_pv_uses_its_ramp(pv, plant):
    pv.write(1, 0x60FF, 0, "i", 100_000_000)
    pv.wait(150)
    before = plant.actual[0]
    pv.control(0x02)
    pv.wait(100)
    assert pv.statusword() & 0x4F == 0x40
    assert plant.actual[0] - before == pytest.approx(0.1**2 / 2 / 10, rel=0.25)  # 0x6085: 10 m/s^2


@pytest.fixture
def csv(host):
    host.write(1, 0x1400, 1, "I", 0x80000201)
    host.write(1, 0x1600, 0, "B", 0)
    for sub, entry in enumerate((0x60400010, 0x60FF0020, 0x60B20010), start=1):
        host.write(1, 0x1600, sub, "I", entry)
    host.write(1, 0x1600, 0, "B", 3)
    host.write(1, 0x1400, 1, "I", 0x201)
    host.nmt(1)
    host.enable(9)
    return host


def cycle(host, velocity, force=0):
    host.send(0x201, struct.pack("<Hih", 0x0F, velocity, force))
    host.send(0x080)
    (frame,) = host.take(0x181)
    host.wait(1)
    return struct.unpack("<Hih", frame.data)


def test_csv_adds_up_exactly(csv, plant):
    start = plant.actual[0]
    for _ in range(1000):
        word, _, _ = cycle(csv, 1_234_567)  # 1234.567 nm a SYNC
    assert word & (MODE_BIT_12 | INTERNAL_LIMIT) == MODE_BIT_12
    for _ in range(3):
        cycle(csv, 0)
    assert (plant.actual[0] - start) * 1e9 == pytest.approx(1_234_567, abs=1)


def test_csv_carries_the_force_offset(csv, plant):
    cycle(csv, 0, 250)
    cycle(csv, 0, 250)
    assert plant.offset[0] == pytest.approx(0.25 * 40.0)


def test_csv_stops_at_the_soft_limit(csv, plant):
    here = csv.read_object(1, 0x6064, 0, "i")
    csv.write(1, 0x607D, 2, "i", here + 50_000)
    for _ in range(100):
        word, position, _ = cycle(csv, 1_000_000)
    assert word & INTERNAL_LIMIT
    assert position == here + 50_000
    for _ in range(5):
        word, position, _ = cycle(csv, -1_000_000)
    assert position < here + 50_000  # what was asked for beyond the limit is forgotten
    assert word & MODE_BIT_12
