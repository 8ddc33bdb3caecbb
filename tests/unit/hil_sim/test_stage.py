"""The stage as a whole, and the same drives served in real time."""

from __future__ import annotations

import struct
import threading
import time

import can
import numpy as np
import pytest

from hil_sim.bus import serve
from hil_sim.stage import START_RANGE, VirtualStage, draw_start_positions


def test_start_positions_come_from_the_seed(stage_settings):
    one = draw_start_positions(stage_settings, 1)
    assert one == draw_start_positions(stage_settings, 1) != draw_start_positions(stage_settings, 2)
    assert all(abs(x) <= START_RANGE for x in one)
    assert all(x / 1e-9 == pytest.approx(round(x / 1e-9), abs=1e-6) for x in one)
    drawn = [x for seed in range(200) for x in draw_start_positions(stage_settings, seed)]
    assert min(drawn) < -0.9 * START_RANGE
    assert max(drawn) > 0.9 * START_RANGE


def test_attached_once(stage, world):
    with pytest.raises(ValueError, match="already"):
        stage.attach(world)


def test_wrong_number_of_start_positions(stage_settings, plant):
    with pytest.raises(ValueError, match="one position per axis"):
        VirtualStage(stage_settings, 1, start=(0.0,), plant=plant)


def test_csp_over_can_is_the_compiled_simulation(stage_settings, world, make_host):
    """Frames add nothing: the same samples as `simulate`, to the nanometre and the permille."""
    from hil_sim.plant import simulate

    stage = VirtualStage(stage_settings, seed=None, start=(0.0, 0.0))
    stage.attach(world)
    k = np.arange(200)
    targets = np.stack([np.clip(k - 20, 0, 100) * 400, np.clip(k - 50, 0, 80) * -250], axis=1)
    offsets = np.where((k > 20) & (k < 120), 90, -15)[:, None] * np.array([1, -1])
    targets[0] = offsets[0] = 0
    with can.Bus(interface="lockstep", channel=world.name) as bus:
        host = make_host(bus)
        host.wait(30)
        host.map_for_csp()
        for node in (1, 2):
            host.enable(8, node)
        host.nmt(1)
        rows = []
        for target, offset in zip(targets.tolist(), offsets.tolist(), strict=True):
            for node in (1, 2):
                pair = struct.pack("<Hih", 0x0F, target[node - 1], offset[node - 1])
                host.send(0x200 + node, pair)
            host.send(0x080)
            rows.append([struct.unpack("<Hih", host.take(0x180 + n)[0].data)[1:] for n in (1, 2)])
            host.wait(1)
    sampled = np.array(rows)
    expected = simulate(stage_settings, targets * 1e-9, offsets * 0.04, seed=None)
    assert np.abs(sampled[:, :, 0] - expected.position * 1e9).max() < 0.01
    assert np.abs(sampled[:, :, 1] - expected.force / 0.04).max() < 0.01
    assert np.ptp(sampled[:, 0, 0]) > 39_000


@pytest.mark.parametrize("seed", [1, 2])
def test_homing_of_the_simulated_stage(stage_settings, world, make_host, seed):
    stage = VirtualStage(stage_settings, seed)
    stage.attach(world)
    with can.Bus(interface="lockstep", channel=world.name) as bus:
        host = make_host(bus)
        host.wait(30)
        for node in (1, 2):
            host.enable(6, node)
            host.control(0x1F, node)
        for _ in range(60):
            host.wait(100)
            words = [host.statusword(node) for node in (1, 2)]
            if all(word & 0x3400 == 0x1400 for word in words):
                break
        assert [hex(word & 0x3400) for word in words] == ["0x1400", "0x1400"]
        assert host.clock.now_ns() < 5e9
        host.wait(200)
        for axis, node in enumerate((1, 2)):
            position = host.read_object(node, 0x6064, 0, "i")
            assert abs(position) < 200  # nm, at rest at the mark
            assert position == stage.plant.encoder(axis)


def test_served_on_a_virtual_bus(stage_settings, plant):
    """Boot-up, heartbeat, SDO, csp and a pp profile in real time, in a thread of its own."""
    channel = "hil-sim-unit-serve"
    stop = threading.Event()
    stage = VirtualStage(stage_settings, 1, plant=plant)
    with (
        can.Bus(interface="virtual", channel=channel) as host,
        can.Bus(interface="virtual", channel=channel) as bus,
    ):

        def wait_for(can_id: int, timeout: float = 100.0) -> bytes:
            end = time.monotonic() + timeout
            while (left := end - time.monotonic()) > 0:
                message = host.recv(left)
                if message is not None and message.arbitration_id == can_id:
                    return bytes(message.data)
            pytest.fail(f"no frame 0x{can_id:03X}")

        def send(can_id: int, data: bytes = b"") -> None:
            host.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

        def write(index: int, fmt: str, value: int) -> None:
            data = struct.pack("<" + fmt, value)
            head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, 0)
            send(0x601, head + data.ljust(4, b"\0"))
            assert wait_for(0x581)[0] == 0x60

        thread = threading.Thread(target=serve, args=(stage, bus, stop))
        thread.start()
        try:
            assert wait_for(0x701) == b"\0"
            write(0x1017, "H", 20)
            assert wait_for(0x701) == bytes((127,))
            write(0x6060, "b", 1)
            for word in (0x06, 0x07, 0x0F):
                write(0x6040, "H", word)
            write(0x607A, "i", 200_000)
            write(0x6040, "H", 0x3F)
            send(0x000, b"\x01\x01")
            end = time.monotonic() + 100.0
            status = 0
            while not status & 0x0400 and time.monotonic() < end:
                status, position = struct.unpack("<Hi", wait_for(0x381))
            assert status & 0x0400
            assert position == 200_000
        finally:
            stop.set()
            thread.join(100.0)
        assert not thread.is_alive()
    assert plant.time_ns > 20_000_000
