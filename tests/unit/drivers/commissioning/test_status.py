"""Statusword, inputs and outputs in plain words."""

import pytest

from drivers.commissioning.status import in_words


@pytest.mark.parametrize(
    ("word", "around", "expected"),
    [
        (0x0237, (), "enabled, under force"),
        (0x0237, (2e-5,), "enabled, holding"),
        (0x0237, (-0.2,), "enabled, moving"),
        (0x0237, (0.0, 0, 0), "enabled, holding; brake released"),
        (0x0250, (0.0, 0b1010, 1), "off, no force; at the positive limit switch; "
         "interlock active (STO or enable input); brake set"),
        (0x0240, (0.0, 0b1000, 1), "off, no force; no supply voltage; "
         "interlock active (STO or enable input); brake set"),
        (0x0240, (), "off, no force; no supply voltage (STO, contactor or mains)"),
        (0x0217, (0.0,), "stopped by quick stop, under force"),
        (0x02B7, (), "enabled, under force; warning"),
    ],
)  # fmt: skip
def test_a_statusword_in_words(word, around, expected):
    assert in_words(word, None, *around) == expected


def test_a_fault_is_described_by_its_code():
    assert in_words(0x0218, 0x7305) == "fault, no force: incremental sensor 1 fault (0x7305)"
