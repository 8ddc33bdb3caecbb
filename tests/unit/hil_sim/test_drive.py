"""The virtual drive as a node: SYNC, neighbours, repeatability, arbitrary frames."""

from __future__ import annotations

import struct

import can
import pytest

from hil_sim.bus.world import World
from hil_sim.stage import VirtualStage


def test_the_counter_starts_at_zero_wherever_the_axis_stands(host, plant):
    assert plant.actual[0] == 2.5e-3
    assert host.read_object(1, 0x6064, 0, "i") == 0


def test_bit_31_of_the_sync_cob_id_has_no_meaning(host):
    host.write(1, 0x1005, 0, "I", 0x80000080)
    assert host.read_object(1, 0x1005, 0, "I") == 0x80000080
    host.nmt(1)
    host.send(0x080)
    assert len(host.take(0x181)) == 1


def test_two_runs_give_the_same_frames(stage_settings, make_host):
    def run() -> list[tuple[int, int, bytes]]:
        world = World("twice")
        VirtualStage(stage_settings, seed=3).attach(world)
        frames = []
        with can.Bus(interface="lockstep", channel="twice") as bus:
            bus.clock.sleep_until_ns(30_000_000)
            make_host(bus).map_for_csp()

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


@pytest.mark.parametrize("code", [0, -1, 0x10000])
def test_an_invalid_error_code_is_refused(stage, host, code):
    with pytest.raises(ValueError, match="error code"):
        stage.drives[0].inject_fault(code)


def test_the_sync_counter(host):
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 1)) == 0x06090030
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 241)) == 0x06090031
    host.write(1, 0x1006, 0, "I", 1000)
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 10)) == 0x08000022
    host.write(1, 0x1006, 0, "I", 0)
    host.write(1, 0x1019, 0, "B", 10)
    host.nmt(1)
    host.send(0x080, b"\x01")
    assert len(host.take(0x181)) == 1
    for _ in range(3):
        host.send(0x080)
    assert host.take(0x181) == []
    assert host.emergencies() == [(0x8240, 0x11)]  # once
    host.nmt(130)
    host.wait(30)
    host.map_for_csp()
    host.nmt(1)
    host.send(0x080)
    assert len(host.take(0x181)) == 1
