"""A drive's factor group and SI units against the settings."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.drive.units import INCREMENT, check_units, read_unit
from drivers.errors import ConfigurationError, NodeError, RefusedError
from drivers.settings import AxisSettings

PITCH = 0.032
RATES = {"x60A9_0": 0xF7010300, "x60AA_0": 0xFA015700}
WRITTEN = {"velocity_unit": 1e-9, "acceleration_unit": 1e-6}


class Drive:
    """Objects of a drive, by (index, sub); reading the index `failing` is an error."""

    failing = abort_code = None

    def __init__(self, **objects):
        self.objects = {
            (int(name[1:5], 16), int(name[6:], 16)): value for name, value in objects.items()
        }

    def has(self, ref):
        return (ref.index, ref.sub) in self.objects

    def read(self, ref):
        if ref.index == self.failing:
            kind = NodeError if self.abort_code is None else RefusedError
            raise kind("read failed", axis="x", obj=ref, abort_code=self.abort_code)
        if not self.has(ref):
            raise RefusedError("read refused", axis="x", obj=ref, abort_code=0x06020000)
        return self.objects[ref.index, ref.sub]


def settings(**changes):
    values = {
        "rated_force": 40.0, "peak_force": 120.0, "travel": (-0.1, 0.1), "velocity": 1.0,
        "acceleration": 10.0, "jerk": 2000.0, "following_error": 1e-3,
    }  # fmt: skip
    return AxisSettings(name="x", node=1, eds=Path("x.eds"), **(values | changes))


def factor_group(increment, unit, **others):
    """A drive of these units; `others`: its objects, None for those that it lacks."""
    objects = {
        "x608F_1": round(PITCH / increment), "x608F_2": 1, "x6091_1": 1, "x6091_2": 1,
        "x6092_1": round(PITCH / unit), "x6092_2": 1, **RATES, "x6076_0": 40_000, **others,
    }  # fmt: skip
    return Drive(**{name: value for name, value in objects.items() if value is not None})


def plain(**others):
    return factor_group(1e-9, 1e-9, **others)


FACTORS = {"x6096_1": 1, "x6096_2": 1, "x6097_1": 1000, "x6097_2": 1}
DEGREES = {"x60A8_0": 0xF7100000, "x60A9_0": 0xFF410300, "x60AA_0": 0xFD105700}
TURNING = {"rotary": True, "velocity_unit": 0.1 * math.pi / 180, "acceleration_unit": 1e-3}


@pytest.mark.parametrize(
    ("drive", "own"),
    [
        *(
            (
                factor_group(increment, unit),
                {"encoder": increment, "increment": unit, "velocity_unit": 1e-9},
            )
            for increment, unit in (
                (1e-9, 1e-9), (5e-9, 1e-9), (1e-9, 1e-8), (20e-6 / 4096, 1e-9), (0.5e-9, 0.5e-9),
            )
        ),
        # the gear ratio is part of the position unit
        (plain(x6091_1=5), {"encoder": 1e-9, "increment": 5e-9, "velocity_unit": 1e-9}),
        (plain(x60A8_0=0xF7010000, **FACTORS), {}),
        (
            plain(x60A9_0=0xFA010300, x60AA_0=0xFD015700),
            {"velocity_unit": 1e-6, "acceleration_unit": 1e-3},
        ),
        # without a factor group the position unit may be stated by 0x60A8
        (Drive(x60A8_0=0xF7010000, x6076_0=40_000, **RATES), {}),
        # a factor states a rate as well
        (plain(x60A9_0=None, x60AA_0=None, **FACTORS), {}),
        # other bits of the polarity are ignored
        (plain(x607E_0=0x00), {}),
        (plain(x607E_0=0x3F), {}),
        (
            factor_group(5e-9, 5e-9, x60A8_0=0x00B50000),
            {"increment": 5e-9, "velocity_unit": 1e-9},
        ),
        (plain(**DEGREES), TURNING),
        # units may deviate by a millionth: factors are fractions of integers
        (plain(x6096_1=10_000_009, x6096_2=10_000_000), {}),
        (plain(x6091_1=10_000_000, x6091_2=10_000_009), {}),
    ],
)  # fmt: skip
def test_units_that_agree_are_accepted(drive, own):
    assert check_units(drive, settings(**own)) == []


CANNOT_USE = ".*a linear axis cannot use it for "


@pytest.mark.parametrize(
    ("others", "own", "message"),
    [
        (
            {"x608F_1": round(PITCH / 5e-9)},
            {"encoder": 5e-9, "increment": 5e-9, "velocity_unit": 1e-9},
            r"0x6092:01 feed: factor group: one position unit is 0\.2 encoder "
            r"increments of 5e-09 m, which is 1e-09 m; the settings say 5e-09 m$",
        ),
        *(
            (others, {}, message)
            for others, message in (
                ({"x6096_1": 10, "x6096_2": 1}, "0x6096:01 .*unit is 1e-08 m/s, .* 1e-09 m/s"),
                ({"x60A9_0": 0xFA010300}, "0x60A9:00 .*velocity unit is 1e-06 m/s, .* 1e-09 m/s"),
                ({"x60AA_0": 0xF7015700}, r"0x60AA:00 .*unit is 1e-09 m/s\^2, .* 1e-06"),
                ({"x6097_1": 1, "x6097_2": 0}, "0x6097:01 .*factor group holds 1 / 0"),
                ({"x6076_0": 41_000}, "0x6076:00 .*the drive says 41 N, the settings 40 N"),
                ({"x6076_0": 39_959}, "0x6076:00 .*the settings 40 N"),
                ({"x6076_0": 40_041}, "0x6076:00 .*the settings 40 N"),
                (
                    {"x60A8_0": 0xFA010000},
                    "0x60A8:00 .*position unit is 1e-06 m, .* say 1e-09 m; add position_unit: "
                    "1e-06 to its drive section if the drive is right$",
                ),
                ({"x6096_1": 10_000_011, "x6096_2": 10_000_000}, "0x6096:01 .*one velocity unit"),
                ({"x6091_1": 10_000_000, "x6091_2": 10_000_011}, "0x6092:01 feed: factor group"),
            )
        ),
        *(
            ({"x607E_0": polarity}, {}, f"0x607E:00 polarity: 0x{polarity & 0xFF:02X} reverses")
            for polarity in (0x40, 0x80, 0xC0, -128)
        ),
        # a factor and a notation that disagree, whichever the settings have
        *(
            (
                {"x6096_1": 1, "x6096_2": 1, "x60A9_0": 0xFA010300},
                {"velocity_unit": unit},
                ".*one velocity unit is",
            )
            for unit in (1e-9, 1e-6)
        ),
        *(
            ({"x6091_1": up, "x6091_2": down}, {}, f"0x6091:01 .*group holds {up} / {down}$")
            for up, down in ((0, 1), (1, 0), (-1, 1), (1, -1), (0, 0), (-1, -1))
        ),
        *(
            (unit, WRITTEN, meaning + CANNOT_USE)
            for unit, meaning in (
                (
                    {"x60A9_0": 0x00B44700},
                    "0x60A9:00 .*: says 0x00B44700: revolutions per minut",
                ),
                ({"x60A9_0": 0xFF410300}, r"0x60A9:00 .*0xFF410300: 10\^-1 degrees per second; "),
                ({"x60A9_0": 0x00015700}, "0x60A9:00 .*metres per second squared; "),
                ({"x60AA_0": 0x00010300}, "0x60AA:00 .*metres per second; "),
                ({"x60A8_0": 0xFF410000}, r"0x60A8:00 .*10\^-1 degrees; "),
                ({"x60A8_0": 0xF7010300}, r"0x60A8:00 .*10\^-9 metres per second; "),
            )
        ),
        (
            {"x60A9_0": 0xFFB50300 - (1 << 32)},
            WRITTEN,
            r"0x60A9:00 .*one velocity unit is 1e-10 m/s, the settings say 1e-09 m/s; ",
        ),
        (
            {"x60A9_0": 0xFFB50300},
            {},
            r"0x60A9:00 .*: 10\^-1 increments per second; increments of what is not known; "
            "add velocity_unit: 1e-10 to its drive section if of the encoder$",
        ),
        ({}, {"rotary": True}, r".*0xF7010300: 10\^-9 metres per second; a rotary axis cannot"),
    ],
)
def test_units_other_than_the_settings_are_refused(others, own, message):
    with pytest.raises(ConfigurationError, match=f"^axis x: {message}"):
        check_units(plain(**others), settings(**own))


def test_a_rated_force_that_the_drive_calculates_may_be_rounded():
    (clause,) = check_units(plain(x6076_0=40_001), settings())
    assert clause.endswith("is 40.001 N, not 40 N: forces are off by as much")
    small = {"rated_force": 0.0273, "peak_force": 0.05}
    assert check_units(plain(x6076_0=27), settings(**small)) == []


def test_missing_unit_objects_are_reported():
    clauses = check_units(Drive(), settings(**WRITTEN))
    assert len(clauses) == 4
    assert clauses[-1] == (
        "0x6076:00 motor rated torque is not offered: the rated force is assumed to be 40 N"
    )


@pytest.mark.parametrize("nothing", [None, 0], ids=["no object", "zero"])
@pytest.mark.parametrize(
    ("index", "name", "key", "one", "dimension"),
    [
        ("60A9", "velocity", "velocity_unit", "1e-09", "m/s"),
        ("60AA", "acceleration", "acceleration_unit", "1e-06", r"m/s\^2"),
    ],
)
def test_a_rate_that_nobody_states_is_refused_with_the_line_to_add(
    nothing, index, name, key, one, dimension
):
    drive = plain(**{f"x{index}_0": nothing})
    with pytest.raises(
        ConfigurationError,
        match=rf"^axis x: 0x{index}:00 .*does not say what it counts {name} in; the machine file "
        rf"must: add {key}: {one} to its drive section if it is {one} {dimension}$",
    ):
        check_units(drive, settings())
    assert check_units(drive, settings(**WRITTEN)) == []


@pytest.mark.parametrize("index", [0x60A8, 0x60A9, 0x60AA])
def test_a_drive_that_does_not_answer_is_not_taken_for_one_that_states_nothing(index):
    drive = plain()
    drive.failing = index
    with pytest.raises(NodeError, match="read failed"):
        check_units(drive, settings(**WRITTEN))


@pytest.mark.parametrize(
    ("notation", "unit"),
    [
        (0xF7010300, 1e-9), (0xFA010300, 1e-6), (0x00010300, 1.0), (0x01010300, 10.0),
        (0xFD014700, 1e-3 / 60), (0x00014800, 1 / 3600),
    ],
)  # fmt: skip
def test_a_velocity_may_count_any_length_per_any_time(notation, unit):
    for value in (notation, notation - (1 << 32)):
        drive = plain(x60A9_0=value)
        check_units(drive, settings(velocity_unit=unit))
        with pytest.raises(ConfigurationError, match=r"^axis x: 0x60A9:00 .*one velocity unit is"):
            check_units(drive, settings(velocity_unit=2 * unit))


def test_a_reason_other_than_a_missing_object_counts_as_no_statement():
    drive = plain()
    drive.failing, drive.abort_code = 0x60A9, 0x08000000
    with pytest.raises(ConfigurationError, match=r"0x60A9:00 .*does not say"):
        check_units(drive, settings())


@pytest.mark.parametrize("missing", ["x6091_1", "x6091_2"])
def test_half_a_factor_counts_as_none(missing):
    (clause,) = check_units(plain(**{missing: None}), settings())
    assert clause == (
        "0x6091:01 motor shaft revolutions is not offered: "
        "one position unit is assumed to be 1e-09 m"
    )


@pytest.mark.parametrize(
    ("value", "words", "base", "per", "size"),
    [
        (0x00010000, "metres", "m", 0, 1.0),
        (0xF7010000, "10^-9 metres", "m", 0, 1e-9),
        (0xFD010300, "10^-3 metres per second", "m", 1, 1e-3),
        (0x03014700, "10^3 metres per minute", "m", 1, 1000 / 60),
        (0x00014800, "metres per hour", "m", 1, 1 / 3600),
        (0xFA015700, "10^-6 metres per second squared", "m", 2, 1e-6),
        (0xFD01A000, "10^-3 metres per second cubed", "m", 3, 1e-3),
        (0x00B44700, "revolutions per minute", "rad", 1, 2 * math.pi / 60),
        (0xFF410000, "10^-1 degrees", "rad", 0, math.pi / 1800),
        (0x00400000, "gon", "rad", 0, math.pi / 200),
        (0x00420000, "minutes of arc", "rad", 0, math.pi / 180 / 60),
        (0x00430000, "seconds of arc", "rad", 0, math.pi / 180 / 3600),
        (0xFD100300, "10^-3 radians per second", "rad", 1, 1e-3),
        (0xFFB50300, "10^-1 increments per second", INCREMENT, 1, 0.1),
        (0x00C00000, "revolutions per minute", "rad", 1, 2 * math.pi / 60),
        (0x00C00300, "revolutions per minute per second", "rad", 2, 2 * math.pi / 60),
        (0x00C10300, "inches per second", "m", 1, 0.0254),
    ],
)
def test_units_that_are_understood(value, words, base, per, size):
    for number in (value, value - (1 << 32)):
        unit = read_unit(number)
        assert (unit.words, unit.base, unit.per) == (words, base, per)
        assert unit.size == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0x00000300, "numbers without dimension per second"),
        (0x00990000, "an unknown unit 0x99"),
        (0x00019900, "metres per an unknown unit 0x99"),
        (0x00010305, "metres per second, and 0x05 in bits that mean nothing"),
    ],
)
def test_units_that_are_not_understood_have_words_and_no_size(value, words):
    unit = read_unit(value)
    assert (unit.words, unit.size) == (words, 0.0)


@given(st.integers(0, 0xFFFFFFFF))
def test_whatever_a_drive_states_is_one_line_with_a_size_or_none(value):
    unit = read_unit(value)
    assert unit.words
    assert "\n" not in unit.words
    assert math.isfinite(unit.size)
    assert unit.size >= 0
