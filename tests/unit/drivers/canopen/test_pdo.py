"""PDO codecs round trip; mappings are configured by the book."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.pdo import TPDO, MappedObject, PdoMapping, configure_pdo, disable_pdo
from drivers.errors import ConfigurationError
from drivers.objects import ObjectRef

# CiA 301 data type -> bits and range, written down apart from the code under test
INTEGERS = {
    0x02: (8, -(2**7), 2**7 - 1), 0x03: (16, -(2**15), 2**15 - 1),
    0x04: (32, -(2**31), 2**31 - 1), 0x15: (64, -(2**63), 2**63 - 1),
    0x05: (8, 0, 2**8 - 1), 0x06: (16, 0, 2**16 - 1),
    0x07: (32, 0, 2**32 - 1), 0x1B: (64, 0, 2**64 - 1),
}  # fmt: skip


def ref(number):
    return ObjectRef(0x6000 + number, number % 3, "something")


@st.composite
def mapping_and_values(draw):
    entries = []
    values = []
    left = 64
    while left >= 8 and (not entries or draw(st.booleans())):
        kind = draw(st.sampled_from([k for k, (bits, _, _) in INTEGERS.items() if bits <= left]))
        bits, low, high = INTEGERS[kind]
        entries.append(MappedObject(ref(len(entries)), kind))
        values.append(draw(st.integers(low, high)))
        left -= bits
    return PdoMapping(tuple(entries)), values


@given(mapping_and_values())
def test_every_mapping_round_trips(case):
    mapping, values = case
    data = mapping.codec.pack(*values)
    assert len(data) * 8 == sum(e.bits for e in mapping.entries)
    assert list(mapping.codec.unpack(data)) == values


@given(mapping_and_values())
def test_values_lie_little_endian_one_after_the_other(case):
    mapping, values = case
    whole = int.from_bytes(mapping.codec.pack(*values), "little")
    for entry, value in zip(mapping.entries, values, strict=True):
        assert whole & (2**entry.bits - 1) == value % 2**entry.bits
        whole >>= entry.bits
    assert whole == 0


@given(st.floats(width=32, allow_nan=False))
def test_real32_round_trips(value):
    mapping = PdoMapping((MappedObject(ref(0), 0x08),))
    assert mapping.codec.unpack(mapping.codec.pack(value)) == (value,)


@pytest.mark.parametrize("kind", [0x01, 0x09, 0x10, 0x16, 0x0F])  # boolean, string, 24 bit, domain
def test_types_without_a_codec_are_refused_by_name(kind):
    with pytest.raises(ConfigurationError, match=r"0x6003:00 something: data type 0x00"):
        MappedObject(ref(3), kind)


def test_more_than_64_bits_are_refused():
    with pytest.raises(ConfigurationError, match="72"):
        PdoMapping((MappedObject(ref(0), 0x1B), MappedObject(ref(1), 0x05)))


class StrictNode:
    """Refuses what CiA 301 forbids while configuring a PDO."""

    name = "x"

    def __init__(self, cob):
        self.held = {(0x1800, 1): cob, (0x1800, 2): 254, (0x1A00, 0): 2}

    def offers(self, obj):
        return obj.index in (0x1800, 0x1A00)

    def read(self, obj):
        return self.held[obj.index, obj.sub]

    def read_if_offered(self, obj):
        return self.held.get((obj.index, obj.sub))

    def write(self, obj, value):
        invalid = self.held[0x1800, 1] >> 31
        if obj.index == 0x1A00:
            assert invalid, "mapping changed while the PDO is valid"
            assert obj.sub == 0 or self.held[0x1A00, 0] == 0, "entry written while count > 0"
        elif obj.sub == 1:
            old = self.held[0x1800, 1]
            assert invalid or value >> 31, "COB-ID changed while the PDO is valid"
            assert not (invalid and not value >> 31) or (old ^ value) & 0x7FF == 0, (
                "new COB-ID and valid in one write"
            )
            assert (old ^ value) >> 30 & 1 == 0, "RTR bit changed"
        else:
            assert invalid, "transmission type changed while the PDO is valid"
        self.held[obj.index, obj.sub] = value


@pytest.mark.parametrize("cob", [0x181, 0xC0000000 | 0x181, 0x40000000 | 0x281, 0x80000000])
def test_a_node_that_insists_on_the_order_of_cia_301_accepts_the_configuration(cob):
    node = StrictNode(cob)
    mapping = PdoMapping((MappedObject(ObjectRef(0x6041, 0, ""), 0x06),))
    configure_pdo(node, TPDO, 0x181, mapping)
    assert node.held == {
        (0x1800, 1): 0x181 | cob & 1 << 30, (0x1800, 2): 1,
        (0x1A00, 0): 1, (0x1A00, 1): 0x60410010,
    }  # fmt: skip
    disable_pdo(node, TPDO)
    assert node.held[0x1800, 1] >> 31 == 1
    disable_pdo(node, TPDO + 6)  # not offered: nothing to do
