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
    """Objects of a drive, by (index, sub)."""

    def __init__(self, **objects):
        self.objects = {
            (int(name[1:5], 16), int(name[6:], 16)): value for name, value in objects.items()
        }

    def has(self, ref):
        return (ref.index, ref.sub) in self.objects

    def read(self, ref):
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
    return Drive(
        x608F_1=round(PITCH / increment), x608F_2=1, x6091_1=1, x6091_2=1,
        x6092_1=round(PITCH / unit), x6092_2=1, **(RATES | {"x6076_0": 40_000} | others),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("increment", "unit"),
    [(1e-9, 1e-9), (5e-9, 1e-9), (1e-9, 1e-8), (20e-6 / 4096, 1e-9), (0.5e-9, 0.5e-9)],
)
def test_position_units_other_than_increments(increment, unit):
    assert (
        check_units(
            factor_group(increment, unit),
            settings(encoder=increment, increment=unit, velocity_unit=1e-9),
        )
        == []
    )


def test_the_gear_ratio_is_part_of_the_position_unit():
    drive = factor_group(1e-9, 1e-9)
    drive.objects[0x6091, 1] = 5
    assert check_units(drive, settings(encoder=1e-9, increment=5e-9, velocity_unit=1e-9)) == []


def test_a_mismatch_names_both_units():
    with pytest.raises(
        ConfigurationError,
        match=r"^axis x: 0x6092:01 feed: factor group: one position unit is 0\.2 encoder "
        r"increments of 5e-09 m, which is 1e-09 m; the settings say 5e-09 m$",
    ):
        check_units(
            factor_group(5e-9, 1e-9), settings(encoder=5e-9, increment=5e-9, velocity_unit=1e-9)
        )


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ({"x6096_1": 10, "x6096_2": 1}, r"0x6096:01 .*velocity unit is 1e-08 m/s, .* 1e-09 m/s"),
        ({"x60A9_0": 0xFA010300}, r"0x60A9:00 .*velocity unit is 1e-06 m/s, .* 1e-09 m/s"),
        ({"x60AA_0": 0xF7015700}, r"0x60AA:00 .*acceleration unit is 1e-09 m/s\^2, .* 1e-06"),
        ({"x6097_1": 1, "x6097_2": 0}, r"0x6097:01 .*factor group holds 1 / 0"),
        ({"x607E_0": 0x80}, r"0x607E:00 polarity: 0x80 reverses positions or velocities"),
        ({"x6076_0": 41_000}, r"0x6076:00 .*the drive says 41 N, the settings 40 N"),
    ],
)
def test_units_other_than_the_settings_are_refused(others, message):
    drive = factor_group(1e-9, 1e-9)
    drive.objects |= Drive(**others).objects
    with pytest.raises(ConfigurationError, match=message):
        check_units(drive, settings())


def test_units_that_agree_are_accepted():
    factors = {"x6096_1": 1, "x6096_2": 1, "x6097_1": 1000, "x6097_2": 1}
    assert check_units(factor_group(1e-9, 1e-9, x60A8_0=0xF7010000, **factors), settings()) == []
    drive = factor_group(1e-9, 1e-9, x60A9_0=0xFA010300, x60AA_0=0xFD015700)
    assert check_units(drive, settings(velocity_unit=1e-6, acceleration_unit=1e-3)) == []


def test_missing_unit_objects_are_reported():
    clauses = check_units(Drive(), settings(**WRITTEN))
    assert len(clauses) == 4
    assert clauses[-1] == (
        "0x6076:00 motor rated torque is not offered: the rated force is assumed to be 40 N"
    )


def test_a_position_unit_without_a_factor_group_may_be_stated_by_0x60a8():
    assert check_units(Drive(x60A8_0=0xF7010000, x6076_0=40_000, **RATES), settings()) == []


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
    drive = factor_group(1e-9, 1e-9)
    del drive.objects[int(index, 16), 0]
    if nothing is not None:
        drive.objects[int(index, 16), 0] = nothing
    with pytest.raises(
        ConfigurationError,
        match=rf"^axis x: 0x{index}:00 .*does not say what it counts {name} in; the machine file "
        rf"must: add {key}: {one} to its drive section if it is {one} {dimension}$",
    ):
        check_units(drive, settings())
    assert check_units(drive, settings(**WRITTEN)) == []


def test_a_factor_states_a_rate_as_well():
    drive = factor_group(1e-9, 1e-9, x6096_1=1, x6096_2=1, x6097_1=1000, x6097_2=1)
    del drive.objects[0x60A9, 0], drive.objects[0x60AA, 0]
    assert check_units(drive, settings()) == []


@pytest.mark.parametrize("index", [0x60A8, 0x60A9, 0x60AA])
def test_a_drive_that_does_not_answer_is_not_taken_for_one_that_states_nothing(index):
    class Silent(Drive):
        def read(self, ref):
            if ref.index == index:
                raise NodeError("read: node 1 does not answer", axis="x", obj=ref)
            return super().read(ref)

    drive = Silent()
    drive.objects = factor_group(1e-9, 1e-9).objects
    with pytest.raises(NodeError, match="does not answer"):
        check_units(drive, settings(**WRITTEN))


@pytest.mark.parametrize("polarity", [0x40, 0x80, 0xC0, -128])
def test_a_polarity_that_reverses_motion_is_refused(polarity):
    with pytest.raises(
        ConfigurationError, match=rf"^axis x: 0x607E:00 .*0x{polarity & 0xFF:02X} reverses"
    ):
        check_units(factor_group(1e-9, 1e-9, x607E_0=polarity), settings())


@pytest.mark.parametrize("polarity", [0x00, 0x3F])
def test_other_bits_of_the_polarity_are_ignored(polarity):
    assert check_units(factor_group(1e-9, 1e-9, x607E_0=polarity), settings()) == []


@pytest.mark.parametrize(
    ("notation", "unit"),
    [
        (0xF7010300, 1e-9), (0xFA010300, 1e-6), (0x00010300, 1.0), (0x01010300, 10.0),
        (0xFD014700, 1e-3 / 60), (0x00014800, 1 / 3600),
    ],
)  # fmt: skip
def test_a_velocity_may_count_any_length_per_any_time(notation, unit):
    for value in (notation, notation - (1 << 32)):
        drive = factor_group(1e-9, 1e-9, x60A9_0=value)
        check_units(drive, settings(velocity_unit=unit))
        with pytest.raises(ConfigurationError, match=r"^axis x: 0x60A9:00 .*one velocity unit is"):
            check_units(drive, settings(velocity_unit=2 * unit))


def test_a_position_may_count_metres_or_encoder_increments():
    increments = factor_group(5e-9, 5e-9, x60A8_0=0x00B50000)
    assert check_units(increments, settings(increment=5e-9, velocity_unit=1e-9)) == []
    metres = factor_group(1e-9, 1e-9, x60A8_0=0xFA010000)
    with pytest.raises(
        ConfigurationError, match=r"0x60A8:00 .*one position unit is 1e-06 m, .* say 1e-09 m$"
    ):
        check_units(metres, settings())


@pytest.mark.parametrize(
    ("unit", "meaning"),
    [
        ({"x60A9_0": 0x00B44700}, "0x60A9:00 .*: says 0x00B44700: revolutions per minute; "),
        ({"x60A9_0": 0xFF410300}, "0x60A9:00 .*0xFF410300: 10\\^-1 degrees per second; "),
        ({"x60A9_0": 0xFFB50300 - (1 << 32)}, "0x60A9:00 .*: 10\\^-1 increments per second; "),
        ({"x60A9_0": 0x00015700}, "0x60A9:00 .*metres per second squared; "),
        ({"x60AA_0": 0x00010300}, "0x60AA:00 .*metres per second; "),
        ({"x60A8_0": 0xFF410000}, "0x60A8:00 .*10\\^-1 degrees; "),
        ({"x60A8_0": 0xF7010300}, "0x60A8:00 .*10\\^-9 metres per second; "),
    ],
)
def test_a_unit_that_a_linear_axis_cannot_use_is_refused(unit, meaning):
    with pytest.raises(
        ConfigurationError, match=f"^axis x: {meaning}.*a linear axis cannot use it for "
    ):
        check_units(factor_group(1e-9, 1e-9, **unit), settings(**WRITTEN))


def test_a_rotary_axis_has_angles_and_no_lengths():
    turning = settings(rotary=True, velocity_unit=0.1 * math.pi / 180, acceleration_unit=1e-3)
    degrees = {"x60A8_0": 0xF7100000, "x60A9_0": 0xFF410300, "x60AA_0": 0xFD105700}
    assert check_units(factor_group(1e-9, 1e-9, **degrees), turning) == []
    with pytest.raises(
        ConfigurationError, match=r"0xF7010300: 10\^-9 metres per second; a rotary axis cannot"
    ):
        check_units(factor_group(1e-9, 1e-9), settings(rotary=True))


def test_a_reason_other_than_a_missing_object_counts_as_no_statement():
    class Refusing(Drive):
        def read(self, ref):
            if ref.index == 0x60A9:
                raise RefusedError("read refused", axis="x", obj=ref, abort_code=0x08000000)
            return super().read(ref)

    drive = Refusing()
    drive.objects = factor_group(1e-9, 1e-9).objects
    with pytest.raises(ConfigurationError, match=r"0x60A9:00 .*does not say"):
        check_units(drive, settings())


def test_a_rate_may_deviate_by_a_millionth():
    near, far = (Drive(x6096_1=n, x6096_2=10_000_000).objects for n in (10_000_009, 10_000_011))
    drive = factor_group(1e-9, 1e-9)
    drive.objects |= near
    assert check_units(drive, settings()) == []
    drive.objects |= far
    with pytest.raises(ConfigurationError, match=r"^axis x: 0x6096:01 .*one velocity unit is"):
        check_units(drive, settings())


def test_a_factor_and_a_notation_that_disagree_are_refused():
    drive = factor_group(1e-9, 1e-9, x6096_1=1, x6096_2=1, x60A9_0=0xFA010300)
    for unit in (1e-9, 1e-6):
        with pytest.raises(ConfigurationError, match="one velocity unit is"):
            check_units(drive, settings(velocity_unit=unit))


@pytest.mark.parametrize(
    ("numerator", "denominator"), [(0, 1), (1, 0), (-1, 1), (1, -1), (0, 0), (-1, -1)]
)
def test_a_factor_that_is_no_positive_fraction_is_refused(numerator, denominator):
    text = rf"^axis x: 0x6091:01 .*factor group holds {numerator} / {denominator}$"
    drive = factor_group(1e-9, 1e-9)
    drive.objects |= {(0x6091, 1): numerator, (0x6091, 2): denominator}
    with pytest.raises(ConfigurationError, match=text):
        check_units(drive, settings())


@pytest.mark.parametrize("missing", [(0x6091, 1), (0x6091, 2)])
def test_half_a_factor_counts_as_none(missing):
    drive = factor_group(1e-9, 1e-9)
    del drive.objects[missing]
    (clause,) = check_units(drive, settings())
    assert clause == (
        "0x6091:01 motor shaft revolutions is not offered: "
        "one position unit is assumed to be 1e-09 m"
    )


def test_a_position_unit_may_deviate_by_a_millionth():
    """Factor groups are fractions of integers; the travel of 0.3 m is out by 0.3 um then."""
    drive = factor_group(1e-9, 1e-9)
    drive.objects |= {(0x6091, 1): 10_000_000, (0x6091, 2): 10_000_009}
    assert check_units(drive, settings()) == []
    drive.objects[0x6091, 2] = 10_000_011
    with pytest.raises(ConfigurationError, match="0x6092:01 feed: factor group"):
        check_units(drive, settings())


@pytest.mark.parametrize("held", [39_999, 40_001])
def test_the_rated_force_agrees_to_the_millinewton(held):
    with pytest.raises(ConfigurationError, match=r"^axis x: 0x6076:00 .*the settings 40 N"):
        check_units(factor_group(1e-9, 1e-9, x6076_0=held), settings())


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
        (0x00C00300, "revolutions per minute per second"),
        (0x00C10000, "inches"),
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
