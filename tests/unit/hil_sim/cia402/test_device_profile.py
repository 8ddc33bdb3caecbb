"""Power states, stops and fault reactions, as a host sees them."""

import struct

import pytest

from hil_sim.cia301.emergency import ENCODER_LOST, OVER_CURRENT, UNDER_VOLTAGE

FAULT, DISABLED = 0x08, 0x40
EMCY = 0x081


def test_quick_stop_ramps_down_and_ends_disabled(streaming, plant):
    streaming.write(1, 0x6085, 0, "I", 1_000_000)  # 1 m/s^2
    speed = 10e-3
    streaming.stream(range(0, 100_000, 10_000), force=50)  # 10 um per ms = 10 mm/s
    plant.commands.clear()
    first = streaming.cycle(100_000, force=50, word=0x02)
    assert first[0] & 0x6F == 0x27
    rows = [streaming.cycle(100_000, force=50, word=0x02) for _ in range(15)]
    assert rows[0][0] & 0x6F == 0x07
    assert rows[-1][0] & 0x4F == 0x40
    assert not plant.powered[0]
    moved = plant.actual[0] - 2.5e-3 - 90e-6
    assert moved == pytest.approx(speed**2 / 2 / 1.0, rel=1e-6)
    assert all(c[3] == 0.0 for c in plant.commands)


def test_quick_stop_that_stays_can_be_left_by_enable(streaming, plant):
    streaming.write(1, 0x605A, 0, "h", 6)
    streaming.stream(range(0, 50_000, 10_000))
    for _ in range(10):
        status, position, _ = streaming.cycle(0, word=0x02)
    assert status & 0x6F == 0x07
    assert status & 0x0400  # at rest
    assert plant.powered[0]
    streaming.cycle(position)
    assert streaming.cycle(position)[0] & 0x6F == 0x27


@pytest.mark.parametrize(("option", "distance"), [(0, 0.0), (1, 100e-6), (2, 25e-6)])
def test_fault_reaction_by_its_option(streaming, plant, option, distance):
    """10 mm/s stopped without ramp, at 0.5 m/s^2 (0x6084) and at 2 m/s^2 (0x6085)."""
    streaming.write(1, 0x6084, 0, "I", 500_000)
    streaming.write(1, 0x6085, 0, "I", 2_000_000)
    streaming.write(1, 0x605E, 0, "h", option)
    streaming.write(1, 0x6007, 0, "h", 1)
    streaming.write(1, 0x1029, 1, "B", 1)
    streaming.write(1, 0x1016, 1, "I", 127 << 16 | 5)
    streaming.send(0x77F, b"\x05")
    for k in range(5):
        streaming.cycle(k * 10_000)
    moving = plant.actual[0]
    streaming.wait(40)
    assert streaming.statusword() & 0x4F == 0x08
    assert not plant.powered[0]
    assert plant.actual[0] - moving == pytest.approx(distance, abs=1e-9)


@pytest.mark.parametrize(("option", "state"), [(0, 0x27), (1, 0x08), (2, 0x40), (3, 0x40)])
def test_lost_heartbeat_of_the_host(host, option, state):
    host.write(1, 0x1016, 1, "I", 127 << 16 | 50)
    host.write(1, 0x6007, 0, "h", option)
    host.enable(8)
    host.wait(200)  # not heard yet: not watched yet
    assert host.statusword() & 0x6F == 0x27
    host.send(0x77F, b"\x05")
    for _ in range(3):
        host.wait(40)
        host.send(0x77F, b"\x05")
    assert host.take(EMCY) == []
    sent = host.clock.now_ns()
    host.wait(100)
    mask = 0x6F if state == 0x27 else 0x4F
    assert host.statusword() & mask == state
    (emcy,) = host.take(EMCY)
    assert struct.unpack_from("<HB", emcy.data) == (0x8130, 0x11)
    assert emcy.time_ns == sent + 50_000_000


@pytest.mark.parametrize(("option", "state"), [(0, 0x27), (1, 0x08), (2, 0x40), (3, 0x40)])
def test_missing_setpoints_cause_the_reaction_of_0x6007(host, option, state):
    """RPDO event timer (0x1400:05), with the reaction of 0x6007; another RPDO does not count."""
    host.nmt(1)
    host.write(1, 0x6007, 0, "h", option)
    host.write(1, 0x1400, 5, "H", 20)
    host.enable(8)
    host.wait(100)  # not before the first one
    assert host.statusword() & 0x6F == 0x27
    for _ in range(50):
        host.cycle(0)
    assert host.take(0x081) == []
    for _ in range(18):
        host.send(0x080)
        host.send(0x301, bytes(8))
        host.wait(1)
    assert host.take(0x081) == []
    host.wait(60)
    assert [int.from_bytes(f.data[:2], "little") for f in host.take(0x081)] == [0x8250]
    assert host.statusword() & 0x6F == state


def test_halt_brakes_and_release_follows_again(streaming):
    streaming.stream(range(0, 50_000, 10_000))
    halted = [streaming.cycle(60_000, word=0x10F) for _ in range(20)]
    assert halted[-1][1] == halted[-2][1] != 60_000
    assert halted[-1][0] & 0x0400
    assert not halted[-1][0] & 0x1000
    streaming.cycle(60_000)
    streaming.cycle(60_000)
    assert streaming.cycle(60_000)[1] == 60_000


def test_disable_operation_stops_by_a_ramp_first(streaming, plant):
    streaming.stream(range(0, 100_000, 10_000))
    streaming.cycle(100_000, word=0x07)
    rows = [streaming.cycle(100_000, word=0x07) for _ in range(20)]
    assert rows[0][0] & 0x6F == 0x27
    assert plant.powered[0] is False
    assert rows[-1][0] & 0x6F == 0x23


@pytest.mark.parametrize(
    ("code", "register"),
    [(ENCODER_LOST, 0x21), (OVER_CURRENT, 0x03), (UNDER_VOLTAGE, 0x05)],
)
def test_faults_without_control_take_the_force_off_at_once(host, stage, plant, code, register):
    host.enable(8)
    stage.drives[0].inject_fault(code)
    assert host.emergencies() == [(code, register)]
    assert host.statusword() & 0x4F == FAULT
    assert not plant.powered[0]
    assert host.read_object(1, 0x603F, 0, "H") == code
    assert host.read_object(1, 0x1003, 1, "I") == code
    assert host.read_object(1, 0x1001, 0, "B") == register
    assert host.reset_fault() & 0x4F == DISABLED
    assert host.emergencies() == [(0, 0)]
    assert host.read_object(1, 0x603F, 0, "H") == 0
    host.enable(8)


def test_a_fault_also_occurs_while_disabled(host, stage):
    stage.drives[0].inject_fault(ENCODER_LOST)
    assert host.statusword() & 0x4F == FAULT
    stage.drives[0].inject_fault(OVER_CURRENT)  # one at a time
    assert host.emergencies() == [(ENCODER_LOST, 0x21)]
    assert host.statusword(2) & 0x4F == DISABLED


def test_safe_torque_off_takes_the_force_and_keeps_it(host, stage, plant):
    host.enable(8)
    stage.drives[0].safe_torque_off(True)
    assert not plant.powered[0]
    assert host.statusword() & 0x5F == DISABLED  # and no supply
    assert host.read_object(1, 0x60FD, 0, "I") == 1 << 3
    assert host.emergencies() == []
    for command in (6, 7, 15):
        assert host.control(command) & 0x5F == DISABLED
    stage.drives[0].safe_torque_off(False)
    assert host.statusword() & 0x5F == DISABLED | 0x10  # nothing comes back by itself
    assert host.read_object(1, 0x60FD, 0, "I") == 0
    host.enable(8)
    assert plant.powered[0]


def test_safe_torque_off_interrupts_a_fault_reaction(host, stage, plant):
    host.write(1, 0x6084, 0, "I", 1_000_000)
    host.write(1, 0x60FF, 0, "i", 50_000_000)
    host.enable(3)
    host.wait(200)
    stage.drives[0].inject_fault(0x4310)
    assert plant.powered[0]
    stage.drives[0].safe_torque_off(True)
    assert not plant.powered[0]
    assert host.statusword() & 0x4F == FAULT
