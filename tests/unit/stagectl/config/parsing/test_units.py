"""Quantities: exact conversion, dimensions checked, everything else one clear reason."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stagectl.config.parsing import units
from stagectl.config.parsing.units import parse_quantity, parse_unit


@pytest.mark.parametrize(
    ("text", "dimension", "expected"),
    [
        ("80 um", units.LENGTH, 80e-6),
        ("80 \u00b5m", units.LENGTH, 80e-6),
        ("80\u03bcm", units.LENGTH, 80e-6),
        ("-25mm", units.LENGTH, -0.025),
        ("2.5 cm", units.LENGTH, 0.025),
        ("1e3 nm", units.LENGTH, 1e-6),
        ("5 ms", units.TIME, 5e-3),
        ("0.1 s", units.TIME, 0.1),
        ("500 mm/s", units.VELOCITY, 0.5),
        ("3 m/s^2", units.ACCELERATION, 3.0),
        ("3 m/s2", units.ACCELERATION, 3.0),
        ("3 m/s\u00b2", units.ACCELERATION, 3.0),
        ("200 m/s^3", units.JERK, 200.0),
        ("40 N", units.FORCE, 40.0),
        ("400 mN", units.FORCE, 0.4),
        ("8 kg", units.MASS, 8.0),
        ("500 g", units.MASS, 0.5),
        ("1.5 kHz", units.FREQUENCY, 1500.0),
        ("0.6 N/um", units.STIFFNESS, 6e5),
        ("20 N s/m", units.DAMPING, 20.0),
        ("20 N/(m/s)", units.DAMPING, 20.0),
        ("600 N/s", units.FORCE_RATE, 600.0),
        ("16.07 MN/(m s)", units.INTEGRAL_GAIN, 16.07e6),
        (3, units.LENGTH, 3.0),
        (0.25, units.NUMBER, 0.25),
    ],
)
def test_quantities_become_si(text, dimension, expected):
    assert parse_quantity(text, dimension) == expected


@given(st.decimals(-1000, 1000, allow_nan=False, places=3))
def test_micrometres_are_the_same_float_as_e_minus_6(number):
    assert parse_quantity(f"{number} um", units.LENGTH) == float(f"{number}e-6")


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("5 ms", "must be a length (SI, or a text such as '80 um'), but '5 ms' is a time"),
        ("5 kg m", "is something else"),
        ("5 parsec", "unknown unit 'parsec'"),
        ("5 m/", "unknown unit 'm/'"),
        ("5 (m", "unknown unit '(m'"),
        ("5 m)", "unknown unit 'm)'"),
        ("5 //m", "unknown unit '//m'"),
        ("5", "is a text: write 5 without quotes"),
        ("um", "is 'um'"),
        ("", "is ''"),
        ("nan um", "is 'nan um'"),
        ("1e999 m", "must be a finite number"),
        ("1_0 m", "unknown unit '_0 m'"),
        (float("inf"), "must be a finite number, is inf"),
        (float("nan"), "must be a finite number, is nan"),
        (True, "is true"),
        (None, "is empty"),
        ([1], "is a list"),
        ({}, "is a mapping"),
    ],
)
def test_everything_else_says_what_was_expected(value, reason):
    with pytest.raises(ValueError, match="must be") as caught:
        parse_quantity(value, units.LENGTH)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.text("mskgNHzu /*()^23-\u00b2x1", max_size=12))
def test_no_text_breaks_the_unit_parser(text):
    try:
        ten, exponents = parse_unit(text)
    except ValueError:
        return
    assert isinstance(ten, int)
    assert len(exponents) == 3
