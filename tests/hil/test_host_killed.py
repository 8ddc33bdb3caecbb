"""The host is killed during a move: the drives stop when they miss its heartbeat.

`stagectl sim` and `stagectl run` as two processes, as users start them; an observer on the same bus
records the times. The journal holds all samples until then.
"""

import signal
import struct
import subprocess
import time

import can
import pytest

from stagectl.store import read_recording, recover_left_over
from tests.processes import drives_on, slow_machine, start

HOST_HEARTBEAT, LOST = 0x77F, 0x8130
CONFIGURED = 0.5
"""What the host sets in 0x1016 [s]."""
RECIPE = """
recipe: slow
macro: {velocity: 0.02, acceleration: 0.5, jerk: 50.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 1.0e-6, hold: 0.01, timeout: 0.1}
moves:
  - repeat: 500
    moves:
      - {to: [0.1, 0.1], kind: macro}
      - {to: [-0.1, -0.1], kind: macro}
"""


class Onlooker:
    """Sees all frames with the times they came at, and reads objects of the drives by SDO."""

    def __init__(self, bus):
        self.bus = bus
        self.last_host_heartbeat = 0.0
        self.lost = {}

    def receive(self, timeout):
        message = self.bus.recv(timeout)
        if message is None:
            return None
        can_id, data = message.arbitration_id, message.data
        if can_id == HOST_HEARTBEAT:
            self.last_host_heartbeat = message.timestamp
        elif can_id in (0x81, 0x82) and int.from_bytes(data[:2], "little") == LOST:
            self.lost.setdefault(can_id - 0x80, message.timestamp)
        return message

    def read(self, node, index, fmt):
        request = struct.pack("<BHB4x", 0x40, index, 0)
        self.bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            answer = self.receive(0.1)
            if (
                answer is not None
                and answer.arbitration_id == 0x580 + node
                and answer.data[0] & 0xF0 == 0x40
                and int.from_bytes(answer.data[1:3], "little") == index
            ):
                return int(struct.unpack_from("<" + fmt, answer.data, 4)[0])
        raise AssertionError(f"node {node} does not answer")


def until(condition, onlooker, seconds, what):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, what
        onlooker.receive(0.02)


@pytest.mark.real_time
def test_the_host_is_killed_in_the_middle_of_a_move(tmp_path, monkeypatch):
    bus = "udp_multicast:239.74.163.78"
    machine = slow_machine(tmp_path, bus, monkeypatch)
    (tmp_path / "recipe.yaml").write_text(RECIPE)
    interface, channel = bus.split(":")
    out = tmp_path / "out"
    journal = out / "recording.journal"
    run = ("run", "recipe.yaml", "--machine", machine, "--bus", bus, "--out", "out")
    with drives_on(bus, machine), can.Bus(interface=interface, channel=channel) as tap:
        onlooker = Onlooker(tap)
        with start(*run, cwd=tmp_path, stderr=subprocess.STDOUT) as host:
            try:

                def recorded():
                    assert host.poll() is None, host.communicate()
                    return journal.exists() and journal.stat().st_size > 12_000

                until(recorded, onlooker, 400, "no samples")
            finally:
                host.send_signal(signal.SIGKILL)
        kept = journal.stat().st_size
        until(lambda: len(onlooker.lost) == 2, onlooker, 60, "the drives have not noticed")
        took = [at - onlooker.last_host_heartbeat for at in onlooker.lost.values()]
        # by that heartbeat and nothing else: to the instant in virtual time (test_drive.py);
        # here frames wait for the drives, so later is no fault of theirs
        assert min(took) > CONFIGURED - 0.1
        until(
            lambda: all(onlooker.read(n, 0x6041, "H") & 0x6F != 0x27 for n in (1, 2)),
            onlooker, 60, "the drives have not stopped",
        )  # fmt: skip
        time.sleep(0.3)
        before = [onlooker.read(node, 0x6064, "i") for node in (1, 2)]
        time.sleep(0.2)
        after = [onlooker.read(node, 0x6064, "i") for node in (1, 2)]
        # 4 mm at the speed it had; without power it rings on its presliding stiffness
        assert max(abs(a - b) for a, b in zip(after, before, strict=True)) < 50_000  # nm
        assert [onlooker.read(node, 0x603F, "H") for node in (1, 2)] == [LOST] * 2
    assert journal.stat().st_size == kept
    recovered = recover_left_over(out)
    assert recovered.content.notes.outcome == "killed"
    recording = read_recording(out / "recording.h5")
    assert len(recording) > 100
    demand = recording.axes["x"].position_demand
    assert abs(demand[-1] - demand[-2]) > 1e-6  # in the middle of a move
    assert not journal.exists()
