"""What the drive watches while its force is on: following error, end switches, full force."""

import struct

from hil_sim.cia301.emergency import OVER_CURRENT, OVER_TRAVEL

EMCY = 0x081


def test_following_error_faults_after_its_time_and_needs_an_edge_to_reset(streaming, plant):
    streaming.write(1, 0x6066, 0, "H", 5)
    plant.blocked[0] = True
    rows = streaming.stream([2_000_000] * 4)
    assert all(r[0] & 0x6F == 0x27 for r in rows)
    for _ in range(10):
        streaming.cycle(2_000_000)
    status = streaming.cycle(2_000_000)[0]
    assert status & 0x4F == 0x08
    assert status & 0x2000
    (emcy,) = streaming.take(EMCY)
    assert struct.unpack_from("<HB", emcy.data) == (0x8611, 0x21)
    assert streaming.read_object(1, 0x603F, 0, "H") == 0x8611
    assert streaming.read_object(1, 0x1003, 1, "I") == 0x8611
    assert not plant.powered[0]
    plant.blocked[0] = False

    streaming.cycle(0, word=0x80)
    assert streaming.cycle(0, word=0x80)[0] & 0x4F == 0x40
    assert streaming.read_object(1, 0x603F, 0, "H") == 0
    assert streaming.take(EMCY)[-1].data[:2] == b"\0\0"

    # the level alone resets nothing
    streaming.cycle(0, word=0x86)
    assert streaming.cycle(0, word=0x86)[0] & 0x4F == 0x40


def test_following_error_window_can_be_switched_off(streaming, plant):
    streaming.write(1, 0x6065, 0, "I", 0xFFFFFFFF)
    plant.blocked[0] = True
    assert streaming.stream([2_000_000] * 30)[-1][0] & 0x6F == 0x27


def test_following_error_in_pp(host, plant):
    plant.blocked[0] = True
    host.enable(1)
    host.write(1, 0x607A, 0, "i", 20_000_000)
    host.control(0x1F)
    host.wait(300)
    assert host.statusword() & 0x204F == 0x2008
    assert host.read_object(1, 0x603F, 0, "H") == 0x8611


def test_short_excursion_is_no_fault(streaming, plant):
    plant.blocked[0] = True
    streaming.stream([2_000_000] * 3)
    plant.blocked[0] = False
    assert streaming.stream([2_000_000] * 20)[-1][0] & 0x6F == 0x27


FAULT, DISABLED, ENABLED = 0x08, 0x40, 0x27


def test_the_end_switch_stops_the_axis_and_lets_it_back(host, plant):
    host.write(1, 0x6065, 0, "I", 0xFFFFFFFF)
    host.enable(1)
    plant.blocked[0] = True  # somebody's hand
    plant.actual[0] = 0.1549  # the switch is 5 mm beyond the travel of 150 mm
    host.wait(5)
    assert host.statusword() & 0x6F == ENABLED
    plant.actual[0] = 0.1551
    host.wait(20)
    assert host.emergencies()[0][0] == OVER_TRAVEL
    assert host.statusword() & 0x4F == FAULT
    assert host.reset_fault() & 0x4F == DISABLED
    host.enable(1)  # still beyond: it may be moved back
    host.wait(10)
    assert host.statusword() & 0x6F == ENABLED
    plant.actual[0] = 0.15
    host.wait(5)
    plant.actual[0] = -0.156
    host.wait(20)
    assert host.statusword() & 0x4F == FAULT


def test_full_force_against_an_obstacle_is_over_current(host, plant):
    host.write(1, 0x6065, 0, "I", 0xFFFFFFFF)  # nobody watches the following error
    plant.force = lambda axis: 120.0 if plant.blocked[axis] else 0.0
    host.write(1, 0x60FF, 0, "i", 1_000_000)
    host.enable(3)
    host.wait(100)
    assert host.statusword() & 0x6F == ENABLED
    plant.blocked[0] = True
    host.wait(150)
    assert host.statusword() & 0x6F == ENABLED
    host.wait(100)
    assert host.statusword() & 0x4F == FAULT
    assert host.emergencies()[0][0] == OVER_CURRENT


def test_end_switches_show_in_the_digital_inputs(host, plant):
    assert host.read_object(1, 0x60FD, 0, "I") == 0
    plant.actual[0] = -0.156
    assert host.read_object(1, 0x60FD, 0, "I") == 1
    plant.actual[0] = 0.156
    assert host.read_object(1, 0x60FD, 0, "I") == 2
