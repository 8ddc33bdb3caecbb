"""`stagectl sim` on a SocketCAN interface that goes down, is removed, and comes back.

The master sends bare frames by python-can. The test creates the interface, which takes root.
"""

import contextlib
import os
import signal
import struct
import subprocess
import time

import can
import pytest

from tests.processes import start

INTERFACE = "stagevcan"
DEADLINE = 30.0
"""Ends a wait that would never end [s]; no statement on speed."""

on_a_vcan = [
    pytest.param(
        f"socketcan:{INTERFACE}",
        id="socketcan",
        marks=[
            pytest.mark.skipif(
                not os.environ.get("STAGECTL_HIL_SOCKETCAN"),
                reason="run by test_vcan.py on a bus of its own",
            ),
            pytest.mark.skipif(os.geteuid() != 0, reason="only root may make an interface"),
        ],
    )
]


def ip(*arguments):
    path = os.environ["PATH"] + ":/usr/sbin:/sbin"
    subprocess.run(["ip", "link", *arguments], check=True, env=os.environ | {"PATH": path})


def make():
    ip("add", "dev", INTERFACE, "type", "vcan")
    ip("set", INTERFACE, "up")


@pytest.fixture
def interface():
    make()
    yield
    with contextlib.suppress(subprocess.CalledProcessError):  # a test that failed without it
        ip("delete", INTERFACE)


class Master:
    """Objects by expedited SDO, and the host's heartbeat while it waits."""

    def __init__(self):
        self.bus = can.Bus(interface="socketcan", channel=INTERFACE)

    def send(self, can_id, data):
        self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def request(self, payload):
        deadline = time.monotonic() + DEADLINE
        while time.monotonic() < deadline:
            self.send(0x77F, b"\x05")
            self.send(0x601, payload)
            until = time.monotonic() + 0.1
            while (left := until - time.monotonic()) > 0:
                answer = self.bus.recv(left)
                if answer is not None and answer.arbitration_id == 0x581:
                    assert answer.data[0] != 0x80, answer
                    if answer.data[1:4] == payload[1:4]:
                        return bytes(answer.data)
        raise AssertionError("node 1 does not answer")

    def write(self, index, sub, fmt, value):
        data = struct.pack("<" + fmt, value)
        head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub)
        self.request(head + data.ljust(4, b"\0"))

    def read(self, index, fmt):
        answer = self.request(struct.pack("<BHB4x", 0x40, index, 0))
        return int(struct.unpack_from("<" + fmt, answer, 4)[0])

    def until(self, condition):
        deadline = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < deadline, "timed out"


@pytest.mark.real_time(judged=False)
@pytest.mark.usefixtures("interface")
@pytest.mark.parametrize("bus", on_a_vcan)
def test_the_drives_wait_for_an_interface_that_goes_down_or_is_removed(bus):
    with start("sim", "--bus", bus) as drives:
        try:
            assert "node 1" in drives.stdout.readline()
            master = Master()
            master.write(0x6060, 0, "b", 1)
            master.write(0x6081, 0, "I", 5_000_000)  # 5 mm/s: half a minute to its target
            for word in (0x80, 0x06, 0x07, 0x0F):
                master.write(0x6040, 0, "H", word)
            master.write(0x607A, 0, "i", 140_000_000)
            master.write(0x1016, 1, "I", 127 << 16 | 1000)
            begin = master.read(0x6064, "i")
            master.write(0x6040, 0, "H", 0x1F)
            master.until(lambda: master.read(0x6064, "i") > begin + 100_000)
            assert master.read(0x6041, "H") & 0x6F == 0x27

            ip("set", INTERFACE, "down")
            line = drives.stderr.readline()
            assert line == f"bus {bus}: Network is down; the drives wait for it\n"
            time.sleep(2.0)  # the drives give their host 1 s
            ip("set", INTERFACE, "up")
            assert drives.stderr.readline() == f"bus {bus}: is back\n"
            master.bus.shutdown()
            master = Master()
            assert master.read(0x6041, "H") & 0x6F != 0x27
            stopped = master.read(0x6064, "i")
            assert stopped < 100_000_000
            assert abs(master.read(0x6064, "i") - stopped) < 100_000
            master.bus.shutdown()

            ip("delete", INTERFACE)
            assert drives.stderr.readline() == line
            make()
            assert drives.stderr.readline() == f"bus {bus}: is back\n"
            master = Master()
            assert master.read(0x6064, "i") == pytest.approx(stopped, abs=100_000)
            master.bus.shutdown()

            ip("set", INTERFACE, "down")
            assert drives.stderr.readline() == line
            drives.send_signal(signal.SIGINT)
            _, rest = drives.communicate(timeout=DEADLINE)
            assert drives.returncode == 0
            assert "Traceback" not in rest
        finally:
            drives.kill()
