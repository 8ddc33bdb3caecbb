"""`stagectl monitor`: frames in words, from drives in real time, until Ctrl-C."""

import os
import re
import signal
import struct
import threading

import can
import pytest

from stagectl.cli.file_kinds import FRAME_LOG
from tests.signals import as_in_a_terminal
from tests.unit.stagectl.cli.conftest import enabled

WAIT = 60.0
LAST_MAPPING = bytes((0x03, 0x1A, 2))
"""The object that the monitor reads last at its start, as an SDO names it."""


@pytest.fixture
def monitored(call, served_drives):
    """The monitor's output, while a bus end talks to the drives, then Ctrl-C."""
    where = f"{served_drives['interface']}:{served_drives['channel']}"

    def go(talk, *options):
        with as_in_a_terminal(), can.Bus(**served_drives) as bus:

            def other():
                while (message := bus.recv(WAIT)) is not None:
                    if message.arbitration_id == 0x582 and message.data[1:4] == LAST_MAPPING:
                        break  # what comes now waits for the monitor
                talk(bus)
                os.kill(os.getpid(), signal.SIGINT)

            thread = threading.Thread(target=other)
            thread.start()
            try:
                failure, out, err = call("monitor", "--bus", where, *options)
            finally:
                thread.join()
        return failure, [re.sub(r"^ *[\d.]+ +", "", line) for line in out.splitlines()], err

    return go


@pytest.mark.real_time
def test_frames_by_node_and_object_until_ctrl_c(monitored, tmp_path):
    log = tmp_path / "frames.asc"

    def talk(bus):
        enabled(bus, node=1)
        send(bus, 0x401, struct.pack("<Hi", 0x0F, 2_000_000))

    failure, lines, err = monitored(talk, "--log", log)
    assert failure == 0
    text = "\n".join(lines)
    assert "x       NMT        start" in text
    assert "x       TPDO 1     Statusword 0x0231 (off, no force, ready)" in text
    assert "Statusword 0x0237 (enabled, under force)" in text
    assert "x       SDO        write 0x6040:00 Controlword = 0x000F (enable operation)" in text
    assert "RPDO 3     Controlword 0x000F (enable operation), Target position 2 mm" in text
    logged = [message.arbitration_id for message in can.LogReader(log)]
    assert {0x000, 0x181, 0x401, 0x581, 0x601} <= set(logged)
    assert f"{len(logged)} frames in" in err


def send(bus, can_id, data):
    bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))


@pytest.mark.real_time
@pytest.mark.parametrize("option", [(), ("--all",)])
def test_frames_that_repeat_are_left_out_and_counted(monitored, option):
    def talk(bus):
        for n in range(20):
            send(bus, 0x201, struct.pack("<H", 0x0006 if n < 10 else 0x0007))

    _, lines, _ = monitored(talk, *option)
    shown = [line for line in lines if "RPDO 1" in line]
    if option:
        assert len(shown) == 20
        assert not any("(+" in line for line in shown)
        return
    assert shown[0] == "x       RPDO 1     Controlword 0x0006 (shutdown)"
    change = next(line for line in shown if "0x0007 (switch on)" in line)
    assert re.search(r"\(\+\d+\)$", change)
    assert len(shown) < 20


def test_a_passive_monitor_sends_nothing(call):
    with can.Bus(interface="virtual", channel="listened") as bus:
        failure, out, err = call("monitor", "--passive", "--for", 0.05, "--bus", "virtual:listened")
        assert bus.recv(0.0) is None
    assert (failure, out) == (0, "")
    assert err == "0 frames in 0.000 s, 0 shown\n"


def test_nodes_that_do_not_answer_are_named(call):
    failure, _, err = call("monitor", "--for", 0.05, "--bus", "virtual:nobody-there")
    assert failure == 0
    assert "axis x: node 1 does not answer; its PDOs are taken to be those of" in err


@pytest.mark.parametrize("suffix", ["asc", "blf", "log", "csv", "trc"])
def test_a_log_of_frames_is_replaced_by_one(tmp_path, suffix):
    path = tmp_path / f"frames.{suffix}"
    with can.Logger(path) as log:
        log(can.Message(1.0, 0x181, is_extended_id=False, data=b"\x37\x02"))
    assert FRAME_LOG.is_at(path)
    path.write_text("axis,x_m\nx,0\n")
    assert not FRAME_LOG.is_at(path)


def test_an_unknown_format_of_the_log_is_refused(call, tmp_path):
    failure, _, err = call("monitor", "--simulate", "--log", tmp_path / "frames.doc")
    assert failure == 2
    assert "unknown format '.doc'" in err
