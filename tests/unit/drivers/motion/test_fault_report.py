"""Commands in words."""

import pytest

from drivers.errors import FaultReport
from drivers.motion.fault_report import command_text, commands_text


@pytest.mark.parametrize(
    ("controlword", "words"),
    [
        (0x0000, "disable voltage"),
        (0x0006, "shutdown"),
        (0x000F, "enable operation"),
        (0x0002, "quick stop"),
        (0x010F, "enable operation + halt"),
        (0x003F, "enable operation + bit 4 + bit 5"),
        (0x0080, "fault reset"),
        (0x0087, "fault reset"),
        (0x0009, "0x0009"),
    ],
)
def test_a_controlword_is_named_by_the_cia402_command_and_its_mode_bits(controlword, words):
    assert command_text(controlword) == words


def test_the_last_commands_come_with_mode_target_and_force_offset():
    report = FaultReport(
        statusword=0x1237, emergencies=(), controlwords=(0x6, 0xF), mode=8,
        target="0.012 m", offset=-1.25, boots=0,
    )  # fmt: skip
    assert commands_text(report) == (
        "shutdown > enable operation, mode 8, target 0.012 m, force offset -1.25 N"
    )
    unsent = FaultReport(None, (), (), None, "0 m", 0.0, 0)
    assert commands_text(unsent).startswith("none, target")
