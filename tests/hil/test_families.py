"""Virtual drives that play a family by its profile, and each habit alone: driven, or refused.

What is refused is refused before power, in one line.
"""

import numpy as np
import pytest

from drivers.errors import ConfigurationError, DriverError
from hil_sim.cia301 import EDS_PATH, key
from hil_sim.habits import Habits
from stagectl.config import parse_machine
from stagectl.config.profiles import families
from tests.lockstep import open_on, switch_on

ENABLE = 0x0F
NO_CSP = "no csp: only moves by the drive's own profile"

FAMILIES = {
    "akd2g": "profile akd2g: the second axis of a device has its objects 0x800 higher",
    "ax8000": "profile ax8000: forces are in 1/1000 of its standstill torque: rated_force has to",
    "circulo": None,
    "copley": "profile copley: fills velocity_unit: 1e-10",
    "el72x1": "forces may have to be multiplied by 1 or 1.414: try check --move",
    "elmo-gold": "profile elmo-gold: its EDS limits 0x1016",
    "epos4": "profile epos4: fills modes: [pp, pv, hm, csp, cst], rated_force_unit",
    "is620n": "profile is620n: the whole product code",
    "jvl-mis": ConfigurationError("0x6041:00 statusword: has no bit 12 (homing attained)"),
    "lenze-9400": "0x60B2:00 torque offset is not mapped (write of",
    "lxm28e": "profile lxm28e: fills modes: [pp, pv, hm, csp]",
    "pd4-e": ConfigurationError("0x60A8:00 SI unit position: one position unit is 2.77778e-06 m"),
    "simpliq": NO_CSP,
}
"""What is said of each with a lead of 10 mm: a limitation, or why it is refused."""


def with_lines(machine, *lines):
    """The machine with these lines in both drive sections."""
    text = machine.text
    for force in ("rated_force: 40.0", "rated_force: 60.0"):
        text = text.replace(force, "\n      ".join((*lines, force)))
    return parse_machine(text, "m.yaml")


def operate(machine, habits=None, alter=None, script=None, **x):
    """Home, enable, jog and stream; the limitations, controlwords sent to x, and the last samples.

    The host knows nothing of `habits` of axis x, of what `alter` does to its drive, and `script` to
    the frames that the drives send.
    """
    drives, world = switch_on(machine, habits=habits, alter=script)
    drive, words, samples = drives.drives[0], [], None
    if alter is not None:
        alter(drive)
    acts = drive.dictionary.on_write[key(0x6040)]
    drive.dictionary.on_write[key(0x6040)] = lambda word: (words.append(word), acts(word))
    error = None
    with open_on(world, machine, **x) as stage:
        try:
            stage.boot()
            stage.check_move_to("x", velocity=0.01, acceleration=1.0)
            stage.home()
            stage.enable()
            goal = stage.positions[0] + 1e-4
            stage.move_to("x", goal, velocity=0.01, acceleration=1.0)
            assert stage.positions[0] == pytest.approx(goal, abs=3e-6)
            if all(axis.streams for axis in stage.axes):
                ramp = np.zeros((200, 2))
                ramp[:, 0] = 25e-6 * (1 - np.cos(np.linspace(0, np.pi, 200)))
                samples = stage.stream(np.array(stage.targets) + ramp, np.zeros_like(ramp))
                moved = samples.position[-1, 0] - samples.position[0, 0]
                assert moved == pytest.approx(50e-6, abs=3e-6)
            stage.disable()
        except DriverError as caught:
            error = caught
        return stage.limitations, words, samples, error


def test_all_families_are_here():
    assert sorted(FAMILIES) == families()


@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_is_operated_or_refused_before_power(family, stage_machine):
    machine = with_lines(stage_machine, f"profile: {family}", "lead: 10 mm")
    said, words, _, error = operate(machine)
    expected = FAMILIES[family]
    if isinstance(expected, ConfigurationError):
        assert isinstance(error, ConfigurationError)
        assert str(error).startswith(f"axis x: {expected}")
        assert ENABLE not in words
        return
    assert error is None
    of_x = [line for line in said if line.startswith("axis x: ")]
    assert any(expected in line for line in of_x) if expected else not of_x


HABITS = {
    "no offset": (Habits(absent=(key(0x60B2),)), "0x60B2:00 torque offset is not offered: "),
    "answers of four bytes": (Habits(long_answers=True), None),
    "in sync": (Habits(in_sync=True), None),
    "steps": (Habits(interpolates=False), None),
    "one TPDO": (Habits(tpdos=1), None),
    "two entries": (Habits(pdo_entries=2), "0x60"),
    "wide offset": (Habits(wide=(key(0x60B2),)), "0x60B2:00 torque offset is not mapped"),
    "no csp claimed": (Habits(values=((key(0x6502), 0x25),)), NO_CSP),
    "no timeout": (
        Habits(values=((key(0x6066), 0),), silent=(key(0x6066),)),
        "0x6066:00 following error timeout is 0 s, not 0.01 s: the drive faults sooner",
    ),
    "weaker quick stop": (
        Habits(only=((key(0x6085), 6_000_000),)),
        "0x6085:00 quick stop deceleration is 6 m/s^2, not 10 m/s^2: quick stops brake by that",
    ),
    "no quick stop to speak of": (
        Habits(only=((key(0x6085), 4_000_000),)),
        ConfigurationError("0x6085:00 quick stop deceleration: write of 10000000 refused"),
    ),
    "only 1 ms": (Habits(only=((key(0x60C2, 2), -3),)), None),
    "large forces": (Habits(force_factor=2**0.5), None),
    "rated in uN": (
        Habits(rated_force_unit=1e-6),
        ConfigurationError("0x6076:00 motor rated torque: the drive says 40000 N"),
    ),
    "slow heartbeat": (
        Habits(limits=((key(0x1017), 200, 0xFFFF),)),
        ConfigurationError("0x1017:00 producer heartbeat time: write of 100 refused"),
    ),
    "csp is mode 9": (Habits(csp_mode=9), NO_CSP),
    "csp is refused": (Habits(modes=(1, 6)), NO_CSP),
    "csp and pp are refused": (
        Habits(modes=(6,), values=((key(0x6502), 0xA0),)),
        ConfigurationError("0x6060:00 modes of operation: write of 8 refused"),
    ),
}
"""Each habit, of a drive that the host has no profile of, and what is said."""


@pytest.mark.parametrize("habit", HABITS)
def test_a_habit_alone(habit, stage_machine):
    habits, expected = HABITS[habit]
    said, words, _, error = operate(stage_machine, habits)
    if isinstance(expected, DriverError):
        assert str(error).startswith(f"axis x: {expected}")
        assert ENABLE not in words
        return
    assert error is None
    assert [line for line in said if line.startswith("axis x: ")] == [
        line for line in said if expected is not None and line.startswith(f"axis x: {expected}")
    ]


def test_csp_by_another_mode_where_the_profile_says_so(stage_machine):
    *_, error = operate(stage_machine, Habits(csp_mode=9), csp_mode=9)
    assert error is None


@pytest.mark.parametrize(
    ("limit", "held", "said"),
    [
        ("HighLimit=0x007F0190", 400, "0x1016:01 consumer heartbeat time is 400 ms, not 500 ms"),
        ("HighLimit=400", 400, "0x1016:01 consumer heartbeat time is 400 ms, not 500 ms"),
        ("LowLimit=0x007F02BC", 700, "0x1016:01 consumer heartbeat time is 700 ms, not 500 ms"),
        ("HighLimit=0xFFFFFFFF", 500, None),
        ("HighLimit=0x007F00C8", None, "0x1016:01 consumer heartbeat time: allows 200 ms by its"),
    ],
)
def test_the_limit_of_an_eds_on_the_watch_over_the_host(limit, held, said, stage_machine, tmp_path):
    eds = tmp_path / "limited.eds"
    text = EDS_PATH.read_text()
    eds.write_text(text.replace("[1016sub1]\n", f"[1016sub1]\n{limit}\n"))
    drives, world = switch_on(stage_machine)
    with open_on(world, stage_machine, eds=eds) as stage:
        if held is None:
            with pytest.raises(ConfigurationError, match=rf"^axis x: {said}"):
                stage.boot()
            return
        stage.boot()
        assert drives.drives[0].dictionary.integer(key(0x1016, 1)) == 127 << 16 | held
        assert any(said in line for line in stage.limitations) if said else not stage.limitations


def test_a_force_of_32_bits_comes_in_a_tpdo_of_its_own(stage_machine, tmp_path):
    eds = tmp_path / "wide.eds"
    before, section, after = EDS_PATH.read_text().partition("[6077]")
    eds.write_text(before + section + after.replace("DataType=0x0003", "DataType=0x0004", 1))
    found = {}
    for name, habits, x in (
        ("narrow", None, {}),
        ("wide", Habits(wide=(key(0x6077),)), {"eds": eds}),
    ):
        said, _, samples, error = operate(stage_machine, habits, **x)
        assert (error, [line for line in said if line.startswith("axis x")]) == (None, [])
        assert samples.valid.all()
        found[name] = samples
    np.testing.assert_array_equal(found["wide"].force, found["narrow"].force)
    assert found["wide"].force[:, 0].any()


def test_without_a_second_tpdo_a_force_of_32_bits_is_left_out(stage_machine, tmp_path):
    eds = tmp_path / "wide.eds"
    before, section, after = EDS_PATH.read_text().partition("[6077]")
    eds.write_text(before + section + after.replace("DataType=0x0003", "DataType=0x0004", 1))
    habits = Habits(wide=(key(0x6077),), tpdos=1)
    said, _, samples, error = operate(stage_machine, habits, eds=eds)
    assert error is None
    assert "axis x: 0x6077:00 torque actual value is not mapped (" in "\n".join(said)
    assert samples.valid.all()
    assert not samples.force[:, 0].any()
