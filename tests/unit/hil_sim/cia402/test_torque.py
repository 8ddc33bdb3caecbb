"""Cyclic synchronous torque: the force itself, within its limit, and back to a closed loop."""

import pytest

from hil_sim.cia402.modes import INTERNAL_LIMIT, MODE_BIT_12

CST = 10
PERMILLE = 0.04  # N: a thousandth of the rated force of axis x


@pytest.fixture
def cst(host, plant):
    plant.open_loop = lambda axis: None  # a commanded force moves nothing here
    host.write(1, 0x6072, 0, "H", 3000)
    host.enable(CST)
    host.nmt(1)
    return host


def torque(host, target=None, offset=0):
    if target is not None:
        host.write(1, 0x6071, 0, "h", target)
    host.write(1, 0x60B2, 0, "h", offset)
    host.send(0x080)
    host.wait(1)


def test_target_and_offset_act_together_at_sync_not_before(cst, plant):
    cst.write(1, 0x6071, 0, "h", 50)
    cst.write(1, 0x60B2, 0, "h", 25)
    assert plant.offset[0] == 0.0
    torque(cst, 50, 25)
    assert plant.offset[0] == pytest.approx(75 * PERMILLE)
    assert cst.statusword() & MODE_BIT_12


@pytest.mark.parametrize("way", [1, -1])
def test_the_sum_is_limited_by_max_torque_and_the_statusword_says_so(cst, plant, way):
    cst.write(1, 0x6072, 0, "H", 100)
    torque(cst, way * 90, way * 30)
    assert plant.offset[0] == pytest.approx(way * 100 * PERMILLE)
    word = cst.statusword()
    assert word & INTERNAL_LIMIT
    assert not word & MODE_BIT_12
    torque(cst, way * 90, 0)
    assert cst.statusword() & (INTERNAL_LIMIT | MODE_BIT_12) == MODE_BIT_12


def test_halt_closes_the_loop_and_takes_no_further_force(cst, plant):
    torque(cst, 50)
    cst.control(0x010F)
    before = len(plant.commands)
    torque(cst, 80)
    assert not [c for c in plant.commands[before:] if c[3] == pytest.approx(80 * PERMILLE)]
    assert plant.demand(0) == pytest.approx(plant.actual[0])


def test_another_mode_begins_where_the_axis_is(cst, plant):
    torque(cst, 50)
    cst.write(1, 0x6060, 0, "b", 8)
    assert cst.read_object(1, 0x6061, 0, "b") == 8
    assert plant.demand(0) == pytest.approx(plant.actual[0])
    assert abs(cst.read_object(1, 0x6064, 0, "i")) < 10
