"""Cyclic synchronous position: targets and force offsets taken over at SYNC."""

import pytest

from hil_sim.cia402.modes import INTERNAL_LIMIT, MODE_BIT_12


def test_csp_takes_the_pair_over_at_sync_and_interpolates(streaming, plant):
    plant.commands.clear()
    rows = streaming.stream([1000, 3000, 3000], force=25)
    x_commands = [c for c in plant.commands if c[1] == 0]
    assert [round(c[2] * 1e9) for c in x_commands] == [2_501_000, 2_503_000, 2_503_000]
    assert all(c[4] == 10 for c in x_commands)
    assert x_commands[0][3] == pytest.approx(25 * 0.04)
    # sampled at the SYNC, before its own setpoint acts: one cycle behind
    assert [row[1] for row in rows] == [0, 1000, 3000]
    assert [row[2] for row in rows] == [0, 25, 25]
    assert rows[-1][0] & 0x1000  # follows the command value


def test_offset_is_cleared_at_enable(host, plant):
    host.write(1, 0x6060, 0, "b", 8)
    host.write(1, 0x60B2, 0, "h", 100)
    host.nmt(1)
    for word in (0x06, 0x07):
        host.cycle(0, force=100, word=word)
    host.cycle(0, force=100, word=0x0F)
    assert plant.commands[-1][3] == 0.0
    host.cycle(0, force=100)
    assert plant.commands[-1][3] == 4.0


def test_target_beyond_the_soft_limit_is_held_at_it(streaming, plant):
    streaming.write(1, 0x607D, 2, "i", 2_000)
    streaming.stream([1000, 2000, 2500, 2600])
    status, position, _ = streaming.cycle(2600)
    assert position == 2000
    assert status & 0x0800
    assert not status & 0x1000
    streaming.cycle(1500)
    assert streaming.cycle(1500)[0] & 0x1800 == 0x1000


def test_interpolation_takes_0x60c2(streaming, plant):
    streaming.write(1, 0x60C2, 1, "B", 2)
    streaming.cycle(1000)
    assert plant.commands[-1][4] == 20


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
