"""The drive as a host sees it: power states, csp, stops, faults, connection loss."""

from __future__ import annotations

import itertools
import struct

import can
import pytest

from hil_sim.bus.lockstep import World
from hil_sim.stage import VirtualStage

HEARTBEAT = 0x701
EMCY = 0x081


def stream(host, targets, **kwargs):
    return [host.cycle(t, **kwargs) for t in targets]


@pytest.fixture
def streaming(host):
    """Axis x in csp, enabled through RPDOs, at rest at 0."""
    host.write(1, 0x6060, 0, "b", 8)
    host.nmt(1)
    for word in (0x06, 0x07, 0x0F):
        host.cycle(0, word=word)
    return host


def test_boot_up_then_identity(host):
    (boot,) = host.take(HEARTBEAT)
    assert boot.data == b"\x00"
    assert boot.time_ns == 20_000_000
    assert host.read_object(1, 0x1018, 1, "I") == 0x00535447
    assert host.read_object(2, 0x1018, 4, "I") == 2
    assert host.upload(1, 0x1008, 0) == b"stagectl linear drive"


def test_units_and_limits_are_those_of_the_axis(host):
    assert host.read_object(1, 0x6076, 0, "I") == 40_000
    assert host.read_object(1, 0x607D, 2, "i") == 150_000_000
    assert host.read_object(1, 0x6065, 0, "I") == 1_000_000
    (kp,) = struct.unpack("<d", host.upload(1, 0x2000, 1))
    assert kp == 341e3
    resolution = host.read_object(1, 0x608F, 1, "I") / host.read_object(1, 0x608F, 2, "I")
    feed = host.read_object(1, 0x6092, 1, "I") / host.read_object(1, 0x6092, 2, "I")
    assert feed / resolution == 1.0  # nm per increment


def test_enabling_one_command_after_another(host, plant):
    assert host.statusword() & 0x4F == 0x40
    assert host.control(0x0F) & 0x4F == 0x40  # not from here
    assert host.control(0x06) & 0x6F == 0x21
    assert host.control(0x07) & 0x6F == 0x23
    assert not plant.powered[0]
    assert host.control(0x0F) & 0x6F == 0x27
    assert plant.powered[0]
    assert host.control(0x07) & 0x6F == 0x23
    assert not plant.powered[0]


def test_the_counter_starts_at_zero_wherever_the_axis_stands(host, plant):
    assert plant.actual[0] == 2.5e-3
    assert host.read_object(1, 0x6064, 0, "i") == 0


def test_csp_takes_the_pair_over_at_sync_and_interpolates(streaming, plant):
    host = streaming
    plant.commands.clear()
    rows = stream(host, [1000, 3000, 3000], force=25)
    x_commands = [c for c in plant.commands if c[1] == 0]
    assert [round(c[2] * 1e9) for c in x_commands] == [2_501_000, 2_503_000, 2_503_000]
    assert all(c[4] == 10 for c in x_commands)
    assert x_commands[0][3] == pytest.approx(25 * 0.04)
    # sampled at the SYNC, before its own setpoint acts: one cycle behind
    assert [row[1] for row in rows] == [0, 1000, 3000]
    assert [row[2] for row in rows] == [0, 25, 25]
    assert rows[-1][0] & 0x1000  # follows the command value


def test_rpdo_without_sync_does_nothing(streaming, plant):
    streaming.wait(0.5)
    plant.commands.clear()
    streaming.send(0x201, struct.pack("<Hih", 0x0F, 5000, 0))
    streaming.wait(5)
    assert plant.commands == []


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
    host = streaming
    host.write(1, 0x607D, 2, "i", 2_000)
    stream(host, [1000, 2000, 2500, 2600])
    status, position, _ = host.cycle(2600)
    assert position == 2000
    assert status & 0x0800
    assert not status & 0x1000
    host.cycle(1500)
    assert host.cycle(1500)[0] & 0x1800 == 0x1000


def test_quick_stop_ramps_down_and_ends_disabled(streaming, plant):
    host = streaming
    host.write(1, 0x6085, 0, "I", 1_000_000)  # 1 m/s^2
    speed = 10e-3
    stream(host, range(0, 100_000, 10_000), force=50)  # 10 um per ms = 10 mm/s
    plant.commands.clear()
    first = host.cycle(100_000, force=50, word=0x02)
    assert first[0] & 0x6F == 0x27
    rows = [host.cycle(100_000, force=50, word=0x02) for _ in range(15)]
    assert rows[0][0] & 0x6F == 0x07
    assert rows[-1][0] & 0x4F == 0x40
    assert not plant.powered[0]
    moved = plant.actual[0] - 2.5e-3 - 90e-6
    assert moved == pytest.approx(speed**2 / 2 / 1.0, rel=1e-6)
    assert all(c[3] == 0.0 for c in plant.commands)


def test_quick_stop_that_stays_can_be_left_by_enable(streaming, plant):
    host = streaming
    host.write(1, 0x605A, 0, "h", 6)
    stream(host, range(0, 50_000, 10_000))
    for _ in range(10):
        status, position, _ = host.cycle(0, word=0x02)
    assert status & 0x6F == 0x07
    assert status & 0x0400  # at rest
    assert plant.powered[0]
    host.cycle(position)
    assert host.cycle(position)[0] & 0x6F == 0x27


def test_following_error_faults_after_its_time_and_needs_an_edge_to_reset(streaming, plant):
    host = streaming
    host.write(1, 0x6066, 0, "H", 5)
    plant.blocked[0] = True
    rows = stream(host, [2_000_000] * 4)
    assert all(r[0] & 0x6F == 0x27 for r in rows)
    for _ in range(10):
        host.cycle(2_000_000)
    status = host.cycle(2_000_000)[0]
    assert status & 0x4F == 0x08
    assert status & 0x2000
    (emcy,) = host.take(EMCY)
    assert struct.unpack_from("<HB", emcy.data) == (0x8611, 0x21)
    assert host.read_object(1, 0x603F, 0, "H") == 0x8611
    assert host.read_object(1, 0x1003, 1, "I") == 0x8611
    assert not plant.powered[0]
    plant.blocked[0] = False

    host.cycle(0, word=0x80)
    assert host.cycle(0, word=0x80)[0] & 0x4F == 0x40
    assert host.read_object(1, 0x603F, 0, "H") == 0
    assert host.take(EMCY)[-1].data[:2] == b"\0\0"

    # the level alone resets nothing
    host.cycle(0, word=0x86)
    assert host.cycle(0, word=0x86)[0] & 0x4F == 0x40


@pytest.mark.parametrize(("option", "distance"), [(0, 0.0), (1, 100e-6), (2, 25e-6)])
def test_fault_reaction_by_its_option(streaming, plant, option, distance):
    """10 mm/s stopped without ramp, at 0.5 m/s^2 (0x6084) and at 2 m/s^2 (0x6085)."""
    host = streaming
    host.write(1, 0x6084, 0, "I", 500_000)
    host.write(1, 0x6085, 0, "I", 2_000_000)
    host.write(1, 0x605E, 0, "h", option)
    host.write(1, 0x6007, 0, "h", 1)
    host.write(1, 0x1029, 1, "B", 1)
    host.write(1, 0x1016, 1, "I", 127 << 16 | 5)
    host.send(0x77F, b"\x05")
    for k in range(5):
        host.cycle(k * 10_000)
    moving = plant.actual[0]
    host.wait(40)
    assert host.statusword() & 0x4F == 0x08
    assert not plant.powered[0]
    assert plant.actual[0] - moving == pytest.approx(distance, abs=1e-9)


def test_following_error_window_can_be_switched_off(streaming, plant):
    streaming.write(1, 0x6065, 0, "I", 0xFFFFFFFF)
    plant.blocked[0] = True
    assert stream(streaming, [2_000_000] * 30)[-1][0] & 0x6F == 0x27


def test_following_error_in_pp(host, plant):
    plant.blocked[0] = True
    host.enable(1)
    host.write(1, 0x607A, 0, "i", 20_000_000)
    host.control(0x1F)
    host.wait(300)
    assert host.statusword() & 0x204F == 0x2008
    assert host.read_object(1, 0x603F, 0, "H") == 0x8611


def test_sync_cob_id_with_the_bit_that_says_nothing(host):
    host.write(1, 0x1005, 0, "I", 0x80000080)
    assert host.read_object(1, 0x1005, 0, "I") == 0x80000080
    host.nmt(1)
    host.send(0x080)
    assert len(host.take(0x181)) == 1


@pytest.mark.parametrize("node", [0, 128, 255])
def test_heartbeat_consumers_that_are_not_used(host, node):
    host.write(1, 0x1016, 1, "I", node << 16 | 10)
    host.write(1, 0x1016, 2, "I", node << 16 | 10)
    assert host.read_object(1, 0x1016, 2, "I") == node << 16 | 10
    host.send(0x700 | node & 0x7F, b"\x05")
    host.wait(30)
    assert host.take(EMCY) == []


def test_error_history_keeps_the_newest_eight(host, plant):
    host.write(1, 0x1016, 1, "I", 127 << 16 | 10)
    for _ in range(10):
        host.send(0x77F, b"\x05")
        host.wait(15)
    assert host.read_object(1, 0x1003, 0, "B") == 8
    assert host.read_object(1, 0x1003, 8, "I") == 0x8130
    assert host.read_object(1, 0x1001, 0, "B") == 0x11
    host.send(0x77F, b"\x05")
    assert host.read_object(1, 0x1001, 0, "B") == 0  # back again, and no fault to reset
    assert host.take(EMCY)[-1].data[:3] == b"\0\0\0"
    host.write(1, 0x1003, 0, "B", 0)
    assert host.read_object(1, 0x1003, 0, "B") == 0


def test_fault_stays_when_the_heartbeat_comes_back(host):
    host.write(1, 0x1016, 1, "I", 127 << 16 | 10)
    host.enable(8)
    host.send(0x77F, b"\x05")
    host.wait(20)
    host.send(0x77F, b"\x05")
    assert host.statusword() & 0x4F == 0x08
    assert host.read_object(1, 0x603F, 0, "H") == 0x8130
    assert host.control(0x80) & 0x4F == 0x40
    assert host.read_object(1, 0x603F, 0, "H") == 0


def test_interpolation_takes_0x60c2(streaming, plant):
    streaming.write(1, 0x60C2, 1, "B", 2)
    streaming.cycle(1000)
    assert plant.commands[-1][4] == 20


def test_a_fault_of_one_node_leaves_the_other_alone(streaming, plant):
    host = streaming
    host.enable(8, node=2)
    plant.blocked[0] = True
    stream(host, [2_000_000] * 20)
    assert host.statusword(1) & 0x4F == 0x08
    assert host.statusword(2) & 0x6F == 0x27


def test_short_excursion_is_no_fault(streaming, plant):
    plant.blocked[0] = True
    stream(streaming, [2_000_000] * 3)
    plant.blocked[0] = False
    assert stream(streaming, [2_000_000] * 20)[-1][0] & 0x6F == 0x27


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


@pytest.mark.parametrize(
    ("option", "state", "emcys"),
    [(0, 0x27, [0x8250]), (1, 0x08, [0x8250]), (2, 0x40, [0x8250]), (3, 0x40, [0x8250])],
)
def test_setpoints_that_stay_away(host, option, state, emcys):
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
    assert [int.from_bytes(f.data[:2], "little") for f in host.take(0x081)] == emcys
    assert host.statusword() & 0x6F == state


def test_lost_heartbeat_leaves_operational(streaming):
    streaming.write(1, 0x1016, 1, "I", 127 << 16 | 50)
    streaming.write(1, 0x1017, 0, "H", 10)
    streaming.send(0x77F, b"\x05")
    streaming.wait(100)
    assert streaming.take(HEARTBEAT)[-1].data == bytes((127,))


def test_stopped_node_answers_no_sdo_and_no_sync(streaming):
    host = streaming
    host.nmt(2)
    host.send(0x080)
    host.send(0x601, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    assert host.take(0x181) == host.take(0x581) == []
    host.nmt(128)
    assert host.statusword() & 0x4F == 0x08  # 0x6007 = 1: fault


def test_reset_node_forgets_everything_and_boots(streaming, plant):
    host = streaming
    host.write(1, 0x6083, 0, "I", 77)
    stream(host, range(0, 100_000, 10_000))
    host.take(HEARTBEAT)
    host.nmt(129, 1)
    host.wait(30)
    assert [f.data for f in host.take(HEARTBEAT)] == [b"\x00"]
    assert not plant.powered[0]
    assert host.read_object(1, 0x6083, 0, "I") == 1_000_000
    assert host.read_object(1, 0x6064, 0, "i") == 0
    assert host.statusword() & 0x4F == 0x40


def test_reset_communication_keeps_the_application(host):
    host.write(1, 0x6083, 0, "I", 77)
    host.write(1, 0x1017, 0, "H", 10)
    host.nmt(130, 1)
    host.wait(30)
    assert host.read_object(1, 0x6083, 0, "I") == 77
    assert host.read_object(1, 0x1017, 0, "H") == 0


def test_heartbeat_period_is_exact(host):
    host.take(HEARTBEAT)
    host.write(1, 0x1017, 0, "H", 25)
    host.wait(100)
    times = [f.time_ns for f in host.take(HEARTBEAT)]
    assert [b - a for a, b in itertools.pairwise(times)] == [25_000_000] * 4


def test_halt_brakes_and_release_follows_again(streaming):
    host = streaming
    stream(host, range(0, 50_000, 10_000))
    halted = [host.cycle(60_000, word=0x10F) for _ in range(20)]
    assert halted[-1][1] == halted[-2][1] != 60_000
    assert halted[-1][0] & 0x0400
    assert not halted[-1][0] & 0x1000
    host.cycle(60_000)
    host.cycle(60_000)
    assert host.cycle(60_000)[1] == 60_000


def test_disable_operation_stops_by_a_ramp_first(streaming, plant):
    host = streaming
    stream(host, range(0, 100_000, 10_000))
    host.cycle(100_000, word=0x07)
    rows = [host.cycle(100_000, word=0x07) for _ in range(20)]
    assert rows[0][0] & 0x6F == 0x27
    assert plant.powered[0] is False
    assert rows[-1][0] & 0x6F == 0x23


def test_two_runs_give_the_same_frames(stage_settings):
    def run() -> list[tuple[int, int, bytes]]:
        world = World("twice")
        VirtualStage(stage_settings, seed=3).attach(world)
        frames = []
        with can.Bus(interface="lockstep", channel="twice") as bus:
            bus.clock.sleep_until_ns(30_000_000)

            def send(can_id: int, data: bytes) -> None:
                bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

            send(0x601, bytes.fromhex("2f60600008000000"))
            send(0x601, bytes.fromhex("2b1710000a000000"))
            send(0x000, b"\x01\x00")
            for k in range(300):
                word = (6, 7)[k] if k < 2 else 15
                send(0x201, struct.pack("<Hih", word, max(0, k - 20) * 500, 20))
                send(0x080, b"")
                bus.clock.sleep_until_ns(30_000_000 + (k + 1) * 1_000_000)
            while (message := bus.recv(0)) is not None:
                frames.append((message.timestamp, message.arbitration_id, bytes(message.data)))
        return frames

    first = run()
    assert first == run()
    position = struct.unpack("<Hih", [f for f in first if f[1] == 0x181][-1][2])[1]
    assert position == pytest.approx(279 * 500 - 500, abs=20_000)
