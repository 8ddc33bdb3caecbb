"""Texts of error codes and of the error register."""

import pytest

from drivers.canopen import error_text, register_text


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


def test_register_text():
    assert register_text(0x21) == "generic, device profile"
    assert register_text(0) == "none"
