"""Values of objects: typed by the EDS on the way in, in words or SI units on the way out."""

from dataclasses import replace

import canopen
import pytest

from drivers.commissioning import meaning, parse, raw_text, reference, type_name, unit_of
from drivers.errors import ConfigurationError
from hil_sim import EDS_PATH
from stagectl.config import driver_settings, load_machine


@pytest.fixture(scope="module")
def axis():
    return driver_settings(load_machine(None))[1][0]


@pytest.fixture(scope="module")
def variable():
    dictionary = canopen.import_od(str(EDS_PATH), 1)
    return dictionary.get_variable


@pytest.mark.parametrize(
    ("place", "text", "value"),
    [
        ((0x607A, 0), "-1000", -1000),
        ((0x6065, 0), "0x10", 16),
        ((0x6040, 0), "65535", 65535),
        ((0x6060, 0), "-128", -128),
        ((0x2000, 1), "1.5e3", 1500.0),
        ((0x1008, 0), "a drive", "a drive"),
    ],
)
def test_a_value_is_typed_by_the_eds(variable, axis, place, text, value):
    found = parse(text, variable(*place), axis)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("place", "text", "reason"),
    [
        ((0x607A, 0), "2147483648", r"must be in -2147483648\.\.2147483647, is 2147483648"),
        ((0x6065, 0), "-1", r"0x6065:00 .* must be in 0\.\.4294967295, is -1"),
        ((0x1600, 0), "9", r"must be in 0\.\.8, is 9"),  # HighLimit of the EDS
        ((0x6065, 0), "much", "is UNSIGNED32, not .much"),
        ((0x6065, 0), "1.5", r"is UNSIGNED32, not .1\.5"),
        ((0x2000, 1), "nan", "is REAL64, not"),
    ],
)
def test_a_value_of_another_kind_is_refused(variable, axis, place, text, reason):
    with pytest.raises(ConfigurationError, match=f"^axis x: .*{reason}"):
        parse(text, variable(*place), axis)


@pytest.mark.parametrize(
    ("place", "value", "raw", "words"),
    [
        ((0x6064, 0), -1, "-1", "-0.000001 mm"),
        ((0x6065, 0), 500_000, "500000", "0.5 mm"),
        ((0x6081, 0), 10_000_000, "10000000", "10 mm/s"),
        ((0x6083, 0), 2_000_000, "2000000", "2 m/s^2"),
        ((0x6099, 1), 1_000_000, "1000000", "1 mm/s"),
        ((0x6077, 0), 25, "25", "1 N"),
        ((0x60F4, 0), 1000, "1000", "0.001 mm"),
        ((0x6066, 0), 10, "10", "10 ms"),
        ((0x1006, 0), 1000, "1000", "1 ms"),
        ((0x6041, 0), 0x1637, "0x1637", "enabled, under force; target reached; bit 12"),
        ((0x6040, 0), 0x000F, "0x000F", "enable operation"),
        ((0x6061, 0), 8, "8", "cyclic synchronous position"),
        ((0x603F, 0), 0x8611, "0x8611", "following error: the axis left its window"),
        ((0x1001, 0), 0x20, "0x20", "device profile"),
        ((0x1400, 1), 0x201, "0x00000201", None),
        ((0x605A, 0), 2, "2", None),
        ((0x607D, 0), 2, "2", None),
    ],
)
def test_a_value_for_people(variable, axis, place, value, raw, words):
    found = variable(*place)
    obj = reference(found)
    assert raw_text(obj, value, len(found)) == raw
    assert meaning(obj, value, axis) == words


def test_an_axis_that_turns_has_angles(variable, axis):
    turning = replace(axis, rotary=True)
    assert unit_of(reference(variable(0x6064, 0)), turning) == (axis.increment, "rad")
    assert meaning(reference(variable(0x6064, 0)), 1_000_000, turning) == "1 mrad"


def test_names_are_those_of_the_eds(variable):
    assert str(reference(variable(0x6041, 0))) == "0x6041:00 Statusword"
    assert "limit: Min position limit" in reference(variable(0x607D, 1)).name
    assert type_name(variable(0x6064, 0)) == "INTEGER32"
