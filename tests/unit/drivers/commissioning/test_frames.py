"""Frames in words, with what the PDOs hold: by the EDS, as read, and as heard."""

import struct
from dataclasses import replace

import pytest

from drivers.commissioning import FrameDecoder
from hil_sim import CSP_DCF_PATH
from hil_sim.cia301 import NmtState
from stagectl.config import driver_settings, load_machine
from tests.unit.drivers.commissioning.conftest import network


@pytest.fixture
def axes():
    return driver_settings(load_machine(None))[1]


@pytest.fixture
def decoder(axes):
    return FrameDecoder(axes)


def line(decoder, can_id, data):
    decoded = decoder.decode(can_id, data)
    return f"{decoded.who} {decoded.service}: {decoded.text}"


@pytest.mark.parametrize(
    ("can_id", "data", "expected"),
    [
        (0x000, "8102", "y NMT: reset node"),
        (0x000, "0100", "all NMT: start"),
        (0x000, "01", "all NMT: 01"),
        (0x080, "", "all SYNC: "),
        (0x080, "07", "all SYNC: 7"),
        (0x082, "1186210000000000", "y EMCY: following error: the axis left its window (0x8611), "
         "error register: generic, device profile"),
        (0x081, "0000000000000000", "x EMCY: no error any more"),
        (0x701, "05", "x heartbeat: operational"),
        (0x77F, "05", "host heartbeat: operational"),
        (0x705, "7f", "node 5 heartbeat: pre-operational"),
        (0x181, "3702", "x TPDO 1: Statusword 0x0237 (enabled, under force)"),
        (0x301, "0f0001", "x RPDO 2: Controlword 0x000F (enable operation), "
         "Modes of operation 1 (profile position)"),
        (0x382, "370640420f00", "y TPDO 3: Statusword 0x0637 (enabled, under force; target "
         "reached), Position actual value 1 mm"),
        (0x181, "370200", "x TPDO 1: 37 02 00 (3 bytes, 2 are mapped)"),
        (0x185, "3702", "node 5 TPDO 1: 37 02 (not mapped)"),
        (0x601, "4041600000000000", "x SDO: read 0x6041:00 Statusword"),
        (0x581, "4b41600037020000", "x SDO: 0x6041:00 Statusword = 0x0237 (enabled, under force)"),
        (0x602, "2365600020a10700", "y SDO: write 0x6065:00 Following error window [nm] = 0.5 mm"),
        (0x582, "6065600000000000", "y SDO: 0x6065:00 Following error window [nm] written"),
        (0x582, "8064600000000206", "y SDO: 0x6064:00 Position actual value [nm] aborted by the "
         "server: Object does not exist (0x06020000)"),
        (0x585, "4b41600037020000", "node 5 SDO: 0x6041:00 = 0x0237 (enabled, under force)"),
        (0x581, "0011223344556677", "x SDO: segment or block 00 11 22 33 44 55 66 77"),
        (0x581, "41081000150000 00", "x SDO: 0x1008:00 Manufacturer device name has 21 bytes, "
         "in segments"),
        (0x581, "4b", "x SDO: 4b"),
        (0x7E5, "04", " 0x7E5: 04"),
    ],
)  # fmt: skip
def test_a_frame(decoder, can_id, data, expected):
    assert line(decoder, can_id, bytes.fromhex(data)) == expected


CSP_FRAME = struct.pack("<Hih", 0x1237, -1_500_000, 25)
CSP_TEXT = (
    "x TPDO 1: Statusword 0x1237 (enabled, under force; bit 12), "
    "Position actual value -1.5 mm, Torque actual value 1 N"
)


def test_mappings_of_a_dcf_are_known(axes):
    assert line(FrameDecoder([replace(axes[0], eds=CSP_DCF_PATH)]), 0x181, CSP_FRAME) == CSP_TEXT


def test_mappings_are_read_from_the_nodes(axes):
    with network(load_machine(None)) as (bus, stage):
        dictionary = stage.drives[0].dictionary
        dictionary.values.update({0x1A0000: 3, 0x1A0002: 0x60640020, 0x1A0003: 0x60770010})
        decoder = FrameDecoder(axes)
        assert decoder.read_nodes(bus) == []
    assert line(decoder, 0x181, CSP_FRAME) == CSP_TEXT


def test_a_node_that_does_not_answer_is_named_and_taken_by_its_eds(axes):
    with network(load_machine(None)) as (bus, stage):
        stage.drives[1].nmt.enter(NmtState.STOPPED)
        decoder = FrameDecoder(axes)
        (silent,) = decoder.read_nodes(bus)
    assert silent.startswith("axis y: node 2 does not answer; its PDOs are taken to be those of")
    assert line(decoder, 0x182, b"\x37\x02").endswith("Statusword 0x0237 (enabled, under force)")


def test_values_of_a_drive_with_other_units_stay_as_they_are(axes):
    with network(load_machine(None)) as (bus, stage):
        stage.drives[0].dictionary.values[0x60A900] = 0x00B44700  # revolutions per minute
        decoder = FrameDecoder(axes)
        (note,) = decoder.read_nodes(bus)
    assert note.startswith("axis x: 0x60A9:00 ")
    assert line(decoder, 0x381, b"\x37\x02\x40\x42\x0f\x00").endswith("actual value [nm] 1000000")
    assert line(decoder, 0x382, b"\x37\x02\x40\x42\x0f\x00").endswith("Position actual value 1 mm")


def test_mappings_are_followed_as_a_host_writes_them(decoder):
    def write(index, sub, value, fmt="I", answer=0x60):
        data = struct.pack("<" + fmt, value)
        head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub)
        decoder.decode(0x601, head + data.ljust(4, b"\0"))
        decoder.decode(0x581, struct.pack("<BHB4x", answer, index, sub))

    write(0x1800, 1, 0xC0000181)
    assert line(decoder, 0x181, b"\x37\x02") == "x TPDO 1: 37 02 (not mapped)"
    write(0x1A00, 0, 0, "B")
    for sub, entry in enumerate((0x60410010, 0x60640020, 0x60770010), 1):
        write(0x1A00, sub, entry)
    write(0x1A00, 0, 3, "B")
    write(0x1800, 1, 0x40000181)
    assert line(decoder, 0x181, CSP_FRAME) == CSP_TEXT
    write(0x1A00, 0, 1, "B", answer=0x80)  # refused by the drive
    assert line(decoder, 0x181, CSP_FRAME) == CSP_TEXT
    decoder.decode(0x701, b"\0")  # it has booted: as at power-on
    assert line(decoder, 0x181, b"\x37\x02") != line(decoder, 0x181, CSP_FRAME)
    assert "(8 bytes, 2 are mapped)" in line(decoder, 0x181, CSP_FRAME)


def test_a_cob_id_of_its_own_is_followed(decoder):
    for data in ("23011801c0030040", "6001180100000000"):
        decoder.decode(0x601 if data.startswith("23") else 0x581, bytes.fromhex(data))
    assert line(decoder, 0x3C0, b"\x50\x02").startswith("x TPDO 2: ")


def test_state_tells_what_is_news(decoder):
    moving = [struct.pack("<Hi", 0x0237, n) for n in (1, 2)]
    first, second = (decoder.decode(0x381, data).state for data in moving)
    assert first == second == (0x0237,)
    assert decoder.decode(0x381, struct.pack("<Hi", 0x0637, 2)).state == (0x0637,)
    assert decoder.decode(0x080, b"\x05").state == decoder.decode(0x080, b"\x06").state == ()
    assert decoder.decode(0x601, bytes.fromhex("4041600000000000")).state is None
