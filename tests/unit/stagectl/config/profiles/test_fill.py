"""What a profile fills: keys that the machine file leaves open, and it says which."""

import math

import pytest

from stagectl.config import parse_machine
from stagectl.config.profiles import fill, load_profile, parse_profile
from stagectl.config.profiles.fill import unit_size


@pytest.fixture
def axis(stage_machine):
    """Axis x with these lines in its drive section."""

    def made(*lines, rotary=False):
        text = stage_machine.text.replace(
            "rated_force: 40.0", "\n      ".join((*lines, "rated_force: 40.0"))
        )
        if rotary:
            text = text.replace("node: 1", "node: 1\n    rotary: true")
        return parse_machine(text, "m.yaml").axes["x"]

    return made


def test_open_keys_are_filled_and_named_in_one_line(axis):
    filled = fill(axis("lead: 10 mm"), load_profile("epos4"))
    assert filled.drive.modes == ("pp", "pv", "hm", "csp", "cst")
    assert filled.drive.velocity_unit == pytest.approx(0.01 / 60)
    assert filled.drive.rated_force_unit == pytest.approx(1e-6 * 2 * math.pi / 0.01)
    assert filled.note == (
        "profile epos4: fills modes: [pp, pv, hm, csp, cst], rated_force_unit: 0.000628319, "
        "velocity_unit: 0.000166667"
    )


def test_what_the_machine_file_says_stays(axis):
    given = "modes: [pp, hm]", "rated_force_unit: 1e-3", "velocity_unit: 1e-9", "lead: 10 mm"
    filled = fill(axis(*given), load_profile("epos4"))
    assert filled.drive == axis(*given).drive
    assert filled.note == ""


def test_without_lead_nothing_is_made_of_rpm_and_torque(axis):
    filled = fill(axis(), load_profile("epos4"))
    assert filled.drive.velocity_unit is None
    assert filled.drive.rated_force_unit == 1e-3


@pytest.mark.parametrize(
    ("notation", "lead", "rotary", "size"),
    [
        (0x00B44700, "10 mm", False, 0.01 / 60),
        (0x00B44700, None, True, 2 * math.pi / 60),
        (0x00B44700, None, False, None),
        (0xFFB50300, None, False, 1e-10),
        (0xFF410000, "36 mm", False, 1e-5),
        (0xFA010300, None, False, 1e-6),
        (0xFA010300, None, True, None),
        (0x00FF0300, None, False, None),
    ],
    ids=["rpm", "rpm of a turning axis", "rpm without lead", "0.1 increment/s", "0.1 degree",
         "um/s", "um/s of a turning axis", "unknown"],
)  # fmt: skip
def test_a_unit_of_cia_303_2_on_an_axis(axis, notation, lead, rotary, size):
    lines = [] if lead is None else [f"lead: {lead}"]
    found = unit_size(axis(*lines, rotary=rotary), notation)
    assert found == (None if size is None else pytest.approx(size, rel=1e-12))


def test_what_no_key_can_hold_is_said_or_kept_from_the_drive(axis):
    def facts(*lines):
        tail = ", source: read, tested: here}\n"
        body = "".join(line + tail for line in lines)
        return parse_profile("family: own\ndrives: mine\n" + body, "own.yaml")

    filled = fill(axis(), facts("csp_mode: {value: 9", "homing_attained: {value: false"))
    assert (filled.csp_mode, filled.homing_attained) == (9, False)
    assert filled.note == "profile own: csp is selected by mode 9"
    assert fill(axis(), facts("offset_sign: {value: -1")).without_offset
    assert not fill(axis(), facts("offset_sign: {value: 1")).without_offset
    late = fill(axis(), facts("demand_delay: {value: 2.0", "interpolates: {value: false"))
    assert late.note == (
        "profile own: csp follows 2 SYNCs late; csp steps from setpoint to setpoint"
    )
