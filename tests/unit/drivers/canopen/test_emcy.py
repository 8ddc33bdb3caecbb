"""Texts of error codes and of the error register."""

import pytest

from drivers.canopen import error_text, register_text
from drivers.canopen.emcy import ERROR_TEXTS


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x8611, "following error: the axis left its window (0x8611)"),
        (0x8130, "heartbeat or life guard error: the drive lost its host (0x8130)"),
        (0x7305, "incremental sensor 1 fault (0x7305)"),
        (0x73FF, "sensor (0x73FF)"),  # by its class
        (0x2399, "current (0x2399)"),
        (0xFF17, "manufacturer specific (0xFF17)"),
        (0xA000, "unknown error (0xA000)"),
    ],
)
def test_error_texts(code, text):
    assert error_text(code) == text


def test_every_code_has_one_line():
    for code in range(0, 0x10000, 7):
        assert "\n" not in error_text(code)
    assert all(ERROR_TEXTS.values())


def test_register_text():
    assert register_text(0x21) == "generic, device profile"
    assert register_text(0) == "none"
