"""What drives state in 0x60A8 to 0x60AA."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.drive.notation import INCREMENT, read


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
def test_units_that_are_understood(
    value: int, words: str, base: str, per: int, size: float
) -> None:
    for number in (value, value - (1 << 32)):
        unit = read(number)
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
def test_units_that_are_not_understood_have_words_and_no_size(value: int, words: str) -> None:
    unit = read(value)
    assert (unit.words, unit.size) == (words, 0.0)


@given(st.integers(0, 0xFFFFFFFF))
def test_whatever_a_drive_states_is_one_line_with_a_size_or_none(value: int) -> None:
    unit = read(value)
    assert unit.words
    assert "\n" not in unit.words
    assert math.isfinite(unit.size)
    assert unit.size >= 0
