"""PDOs as a drive has them at power-on (CiA 402's default mappings), and the DCF for csp."""

import struct

import canopen
import pytest

from hil_sim import CSP_DCF_PATH, EDS_PATH
from hil_sim.cia402.state_machine import State

RECEIVED = (
    [0x60400010],
    [0x60400010, 0x60600008],
    [0x60400010, 0x607A0020],
    [0x60400010, 0x60FF0020],
)
SENT = ([0x60410010], [0x60410010, 0x60610008], [0x60410010, 0x60640020], [0x60410010, 0x606C0020])
MS = 1_000_000


@pytest.fixture
def operational(fresh):
    fresh.nmt(1, 1)
    fresh.frames.clear()
    return fresh


@pytest.mark.parametrize(
    ("communication", "cob", "mapping", "objects"),
    [
        *[(0x1400 + n, 0x201 + 0x100 * n, 0x1600 + n, o) for n, o in enumerate(RECEIVED)],
        *[(0x1800 + n, 0x40000181 + 0x100 * n, 0x1A00 + n, o) for n, o in enumerate(SENT)],
    ],
)
def test_they_are_those_of_cia_402(fresh, communication, cob, mapping, objects):
    assert fresh.read_object(1, communication, 1, "I") == cob  # valid
    assert fresh.read_object(1, communication, 2, "B") == 255
    count = fresh.read_object(1, mapping, 0, "B")
    assert [fresh.read_object(1, mapping, s, "I") for s in range(1, count + 1)] == objects


def test_mode_target_and_set_point_by_rpdos_2_and_3(operational, plant):
    operational.write(1, 0x6081, 0, "I", 50_000_000)
    operational.send(0x301, struct.pack("<Hb", 0x00, 1))
    assert operational.read_object(1, 0x6061, 0, "b") == 1
    for word in (0x06, 0x07, 0x0F):
        operational.send(0x201, struct.pack("<H", word))
    operational.send(0x401, struct.pack("<Hi", 0x3F, 300_000))
    operational.send(0x401, struct.pack("<Hi", 0x2F, 300_000))
    operational.wait(500)
    status, position = struct.unpack("<Hi", operational.take(0x381)[-1].data)
    assert status & 0x0400
    assert position == 300_000
    assert plant.actual[0] == pytest.approx(2.5e-3 + 300e-6, abs=1e-9)


def test_a_change_of_the_statusword_sends_all_four_tpdos_at_once(operational):
    start = operational.clock.now_ns()
    operational.send(0x201, struct.pack("<H", 0x06))
    sent = [operational.take(0x181 + 0x100 * n) for n in range(4)]
    assert [[f.time_ns for f in frames] for frames in sent] == [[start]] * 4
    assert [f.data[:2] for (f,) in sent] == [struct.pack("<H", operational.statusword())] * 4
    assert [len(f.data) for (f,) in sent] == [2, 3, 6, 6]


def test_tpdos_come_every_100_ms_where_nothing_changes(operational):
    """So that a master that waits for a periodic one (canopen: 0.2 s) has it."""
    start = operational.clock.now_ns()
    operational.wait(350)
    for can_id in (0x181, 0x281, 0x381, 0x481):
        stamps = [(f.time_ns - start) / MS for f in operational.take(can_id)]
        assert stamps == [100.0, 200.0, 300.0]


def test_a_sync_sends_and_moves_nothing(operational):
    operational.send(0x080)
    assert not operational.frames


def test_a_change_of_the_mode_is_an_event(operational):
    operational.write(1, 0x6060, 0, "b", 1)
    (frame,) = operational.take(0x281)
    assert struct.unpack("<Hb", frame.data)[1] == 1


def test_reset_communication_brings_them_back(host, stage):
    host.nmt(130, 1)
    host.wait(30)
    host.nmt(1, 1)
    host.send(0x201, struct.pack("<H", 0x06))
    assert stage.drives[0].motion.state is State.READY


def test_the_dcf_is_the_eds_with_values_for_pdos_only():
    def body(path):
        lines = path.read_text().partition("[DummyUsage]")[2].splitlines()
        return [line for line in lines if not line.startswith("ParameterValue=")]

    assert body(CSP_DCF_PATH) == body(EDS_PATH)
    valued = [
        variable.index
        for entry in canopen.import_od(str(CSP_DCF_PATH), 1).values()
        if not isinstance(entry, canopen.objectdictionary.ODVariable)
        for variable in entry.values()
        if variable.value is not None
    ]
    assert len(valued) == CSP_DCF_PATH.read_text().count("ParameterValue=")
    assert all(0x1400 <= index < 0x1C00 for index in valued)
