"""The probe on a scripted drive: sizes and signs, what it notes, and silence."""

import pytest
from canopen import SdoAbortedError, SdoCommunicationError

from drivers.canopen import Network
from drivers.commissioning.conformance.probe import Probe, code_of

ABSENT = 0x06020000


@pytest.fixture
def probe(scripted):
    network = Network(scripted, "scripted", beats=False)
    probe = Probe(network, 1)
    probe.group = "group"
    yield probe
    probe.close()


@pytest.mark.parametrize(
    ("index", "sub", "code"),
    [
        (0x6060, 0, "b"), (0x6077, 0, "h"), (0x6064, 0, "i"), (0x607D, 1, "i"), (0x607D, 0, "B"),
        (0x1A00, 0, "B"), (0x1A00, 1, "I"), (0x1800, 1, "I"), (0x1800, 2, "B"), (0x1016, 0, "B"),
        (0x1016, 1, "I"), (0x6040, 0, "H"), (0x60C2, 1, "B"), (0x60C2, 2, "b"), (0x1000, 0, "I"),
    ],
)  # fmt: skip
def test_sizes_of_objects_are_those_of_the_standards(index, sub, code):
    assert code_of(index, sub) == code


def test_values_are_read_with_their_sign_and_written_with_their_size(probe, scripted):
    drive = scripted.drives[0]
    drive.objects[0x60B2, 0] = -5 & 0xFFFF
    assert probe.read(0x60B2) == -5
    probe.write(0x607D, 1, -7)
    assert drive.objects[0x607D, 1] == 2**32 - 7
    assert drive.sizes[0x607D, 1] == 4
    probe.write(0x1017, 0, 50)
    assert drive.sizes[0x1017, 0] == 2


def test_after_silence_the_rest_is_still_to_be_restored(probe, scripted):
    probe.change(0x6066, 0, 11)
    scripted.drives[0].silent = True
    with pytest.raises(SdoCommunicationError):
        probe.restore()
    assert probe.changed
    scripted.drives[0].silent = False
    assert probe.restore() == []
    assert scripted.drives[0].objects[0x6066, 0] == 0


def test_an_absent_object_is_not_offered_but_silence_is_an_error(probe, scripted):
    scripted.drives[0].refuse[0x6007, 0] = ABSENT
    assert not probe.offers(0x6007)
    with pytest.raises(SdoAbortedError):
        probe.read(0x6007)
    scripted.drives[0].silent = True
    with pytest.raises(SdoCommunicationError):
        probe.offers(0x6007)


def test_emergencies_heartbeats_and_tpdos_of_this_node_are_noted(probe, scripted):
    scripted.deliver(0x081, b"\x30\x81\x11\0\0\0\0\0")
    scripted.deliver(0x081, b"\x30\x81")  # no EMCY: eight bytes are
    scripted.deliver(0x082, b"\x10\x43\x11\0\0\0\0\0")
    scripted.deliver(0x701, b"\x85")
    scripted.deliver(0x281, b"\x01\x02")
    probe.network.pump(0.001)
    assert probe.emergencies == [0x8130]
    assert [state for _, state in probe.beats] == [5]
    assert probe.tpdos == [(0x281, b"\x01\x02")]
    assert "0x8130" in probe.fault_text()
