"""Third-party masters and tools with our virtual drives; the host's side is not ours.

The master is canopen's CiA 402 profile, which knows the drive from its EDS; the checker and the
generator of configurations are Lely's dcf-tools.
"""

import configparser
import runpy
import subprocess
import sys
import sysconfig
import threading
import time
import uuid
from dataclasses import replace
from pathlib import Path

import can
import canopen
import pytest
from canopen.profiles.p402 import BaseNode402
from canopen.sdo import SdoClient

from hil_sim import CSP_DCF_PATH, EDS_PATH
from hil_sim.bus import serve
from hil_sim.stage import VirtualStage
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import stage_settings

EXAMPLE = Path(__file__).parents[2] / "examples" / "canopen_master.py"
SCRIPTS = Path(sysconfig.get_path("scripts"))
PERIOD = 0.01
MM, MM_S, M_S2 = 1_000_000, 1_000_000, 1_000_000
"""Units of the drive: 1 nm, 1 nm/s, 1 um/s^2."""
ANSWERED_WITHIN, HOMED_WITHIN, MOVED_WITHIN = 30.0, 60.0, 30.0
"""Not what it waits by itself, 0.2 s and up [s]: its threads get no real-time priority."""

lelys = pytest.mark.skipif(
    not (SCRIPTS / "dcfchk").exists(), reason="Lely's tools are missing: pip install dcf-tools"
)


@pytest.fixture(scope="module")
def drives():
    """Both drives in real time on a python-can bus, their name."""
    settings = replace(stage_settings(load_machine(None)), sync_period=PERIOD)
    stage = VirtualStage(settings, seed=1, start=(-5e-4, -4e-4))
    stage.plant.advance_to(1_000_000)  # compiled before anybody waits
    channel, stop = f"third-{uuid.uuid4().hex}", threading.Event()
    with (
        can.Bus(interface="virtual", channel=channel) as bus,
        can.Bus(interface="virtual", channel=channel) as listener,
    ):
        thread = threading.Thread(target=serve, args=(stage, bus, stop))
        thread.start()
        # Else a boot-up at power-on is taken for the answer to a reset that is still to come.
        booted = set()
        while not booted >= {0x701, 0x702}:
            message = listener.recv(ANSWERED_WITHIN)
            assert message is not None, "no boot-up"
            if message.data == b"\0":
                booted.add(message.arbitration_id)
        yield channel
        stop.set()
        thread.join()


def wait_longer(monkeypatch):
    """Canopen's own timeouts suit a machine that does nothing else."""
    monkeypatch.setattr(SdoClient, "RESPONSE_TIMEOUT", ANSWERED_WITHIN)
    for name in ("RESET_FAULT", "SWITCH_OP_MODE", "SWITCH_STATE_FINAL", "SWITCH_STATE_SINGLE",
                 "CHECK_TPDO"):  # fmt: skip
        monkeypatch.setattr(BaseNode402, f"TIMEOUT_{name}", ANSWERED_WITHIN)


@pytest.fixture
def network(drives, monkeypatch):
    wait_longer(monkeypatch)
    network = canopen.Network()
    network.connect(interface="virtual", channel=drives)
    yield network
    network.sync.stop()
    network.disconnect()


def until(condition, within):
    deadline = time.monotonic() + within
    while not condition():
        assert time.monotonic() < deadline, "timed out"
        time.sleep(PERIOD)


def configuration(path):
    """A device configuration file: the EDS with values to be downloaded."""
    text = EDS_PATH.read_text()
    for section, value in (("1017", 100), ("6065", 2 * MM), ("60C2sub1", round(PERIOD * 1e3))):
        text = text.replace(f"[{section}]\n", f"[{section}]\nParameterValue={value}\n")
    path.write_text(text)
    return path


@pytest.mark.real_time
def test_a_cia_402_master_configures_enables_homes_and_runs_every_mode(network, tmp_path):
    node = BaseNode402(1, str(configuration(tmp_path / "drive.dcf")))
    network.add_node(node)
    node.nmt.send_command(0x81)
    node.nmt.wait_for_bootup(ANSWERED_WITHIN)
    assert node.sdo[0x1000].raw & 0xFFFF == 402
    node.load_configuration()
    assert node.sdo[0x6065].raw == 2 * MM
    assert node.sdo[0x1017].raw == 100

    node.tpdo.read()
    node.rpdo.read()
    for pdo, objects in ((node.rpdo[1], (0x6040,)), (node.rpdo[2], (0x607A,)),
                         (node.rpdo[3], (0x60FF,)), (node.tpdo[1], (0x6041, 0x6061)),
                         (node.tpdo[2], (0x6064, 0x606C))):  # fmt: skip
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.trans_type, pdo.enabled = (255 if pdo is node.rpdo[1] else 1), True
        pdo.save()
    network.sync.start(PERIOD)
    node.nmt.state = "OPERATIONAL"
    node.setup_402_state_machine()
    until(lambda: node.state == "SWITCH ON DISABLED", ANSWERED_WITHIN)

    # hm
    node.op_mode = "HOMING"
    node.sdo[0x6098].raw = 34
    node.state = "OPERATION ENABLED"
    until(lambda: node.statusword & 0x0400, ANSWERED_WITHIN)  # at standstill, before it starts
    node.controlword = 0x1F
    until(lambda: node.statusword & 0x3400 == 0x1400, HOMED_WITHIN)
    position = node.sdo[0x6064]
    assert abs(position.raw) < 0.1 * MM

    # pp: the whole handshake
    node.controlword = 0x0F
    node.op_mode = "PROFILED POSITION"
    node.sdo[0x6081].raw = 20 * MM_S
    node.sdo[0x6083].raw = node.sdo[0x6084].raw = 1 * M_S2
    node.sdo[0x607A].raw = 2 * MM
    node.controlword = 0x3F
    until(lambda: node.statusword & 0x1000, ANSWERED_WITHIN)
    node.controlword = 0x2F
    until(lambda: not node.statusword & 0x1000, ANSWERED_WITHIN)
    until(lambda: node.statusword & 0x0400, MOVED_WITHIN)
    assert abs(position.raw - 2 * MM) < 0.01 * MM

    # pv
    node.op_mode = "PROFILED VELOCITY"
    node.rpdo[3][0].raw = 10 * MM_S
    node.rpdo[3].transmit()
    until(lambda: node.statusword & 0x0400 and position.raw > 3 * MM, MOVED_WITHIN)
    assert abs(node.sdo[0x606C].raw - 10 * MM_S) < 2 * MM_S
    node.rpdo[3][0].raw = 0
    node.rpdo[3].transmit()
    until(lambda: abs(node.sdo[0x606C].raw) < 0.2 * MM_S, MOVED_WITHIN)

    # csp: a set-point before each SYNC that the network sends by itself
    begin = target = position.raw
    node.rpdo[2][0].raw = target
    node.rpdo[2].start(PERIOD)
    node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    until(lambda: node.statusword & 0x1000, ANSWERED_WITHIN)
    for _ in range(50):
        target -= 20_000
        node.rpdo[2][0].raw = target
        node.rpdo[2].update()
        time.sleep(PERIOD)
    until(lambda: abs(position.raw - (begin - 1 * MM)) < 0.01 * MM, ANSWERED_WITHIN)
    node.rpdo[2].stop()

    # csv
    node.rpdo[3][0].raw = -5 * MM_S
    node.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
    begin = position.raw
    node.rpdo[3].transmit()
    until(lambda: position.raw < begin - 1 * MM, MOVED_WITHIN)
    node.rpdo[3][0].raw = 0
    node.rpdo[3].transmit()
    until(lambda: abs(node.sdo[0x606C].raw) < 0.2 * MM_S, MOVED_WITHIN)

    assert node.state == "OPERATION ENABLED"
    assert node.emcy.active == []
    node.state = "SWITCH ON DISABLED"


@pytest.mark.real_time
def test_the_example_moves_an_axis_without_mapping_anything(served_drives, monkeypatch):
    wait_longer(monkeypatch)
    example = runpy.run_path(str(EXAMPLE))
    moved = example["move"](**served_drives, distance=2 * MM, timeout=MOVED_WITHIN)
    assert abs(moved - 2 * MM) < 0.01 * MM


def lely(tool, *arguments, cwd=None):
    """One of Lely's tools."""
    return subprocess.run(
        [sys.executable, SCRIPTS / tool, *arguments],
        cwd=cwd, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip


@lelys
@pytest.mark.parametrize("path", [EDS_PATH, CSP_DCF_PATH], ids=["eds", "dcf"])
@pytest.mark.parametrize("node", ["1", "127"])
def test_lelys_checker_accepts_our_files(path, node):
    checked = lely("dcfchk", "-n", node, path)
    assert (checked.returncode, checked.stdout + checked.stderr) == (0, "")


NETWORK = """
master: {node_id: 127, baudrate: 1000, sync_period: 1000, heartbeat_producer: 100}
x:
  dcf: EDS
  node_id: 1
  heartbeat_producer: 100
  heartbeat_consumer: true
  rpdo:
    1: {enabled: true, transmission: 1,
        mapping: [{index: 0x6040}, {index: 0x607A}, {index: 0x60B2}]}
  tpdo:
    1: {enabled: true, cob_id: auto, transmission: 1,
        mapping: [{index: 0x6041}, {index: 0x6064}, {index: 0x6077}]}
  sdo: [{index: 0x6065, value: 1500000}, {index: 0x605E, value: 2}]
"""


def concise(data):
    """Entries of a concise DCF (CiA 302): index, sub-index, bytes."""
    count, at = int.from_bytes(data[:4], "little"), 4
    for _ in range(count):
        index, sub = int.from_bytes(data[at : at + 2], "little"), data[at + 2]
        size = int.from_bytes(data[at + 3 : at + 7], "little")
        yield index, sub, data[at + 7 : at + 7 + size]
        at += 7 + size
    assert at == len(data)


@lelys
@pytest.mark.real_time
def test_the_drive_accepts_what_lelys_generator_makes_of_the_eds(network, tmp_path):
    """As a CiA 302 master downloads it: entry by entry, and everything reads back."""
    (tmp_path / "network.yml").write_text(NETWORK.replace("EDS", str(EDS_PATH)))
    made = lely("dcfgen", "-r", "network.yml", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    master = configparser.RawConfigParser(strict=True)
    master.read(tmp_path / "master.dcf")
    assert master.has_section("1F22")
    node = network.add_node(1, str(EDS_PATH))
    node.nmt.send_command(0x82)
    node.nmt.wait_for_bootup(ANSWERED_WITHIN)
    entries = list(concise((tmp_path / "x.bin").read_bytes()))
    assert len(entries) > 15
    for index, sub, data in entries:
        node.sdo.download(index, sub, data)
    for index, sub, data in {(i, s): (i, s, d) for i, s, d in entries}.values():
        assert node.sdo.upload(index, sub) == data
    assert node.sdo[0x6065].raw == 1_500_000
