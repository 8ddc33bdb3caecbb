"""Parameters of a mode: the limits that keep it a vibration."""

import pytest

from hil_sim.effects import oscillator

FREQUENCY, DAMPING, RATIO = oscillator(
    ("of a part", (50.0, 300.0)), ("of its mount", (0.01, 0.1)), ("of the part", (0.02, 0.2))
)


def test_ranges_and_meanings_are_the_callers():
    assert (FREQUENCY.meaning, FREQUENCY.plausible) == ("of a part", (50.0, 300.0))
    assert (DAMPING.plausible, RATIO.plausible) == ((0.01, 0.1), (0.02, 0.2))
    assert [p.key for p in (FREQUENCY, DAMPING, RATIO)] == ["frequency", "damping", "mass_ratio"]


def test_without_mass_there_is_no_mode():
    assert (RATIO.role, RATIO.neutral) == ("size", 0.0)
    assert {p.role for p in (FREQUENCY, DAMPING)} == {"shape"}


@pytest.mark.parametrize(
    ("parameter", "inside", "outside"),
    [
        (FREQUENCY, (1e-3, 1499.0), (0.0, 1500.0)),
        (DAMPING, (0.0, 0.99), (-1e-3, 1.0)),  # 1: it no longer vibrates
        (RATIO, (0.0, 0.99), (-0.1, 1.0)),  # 1: nothing would be left of the carriage
    ],
)
def test_limits(parameter, inside, outside):
    assert [v for v in inside if parameter.refusal(v)] == []
    assert [v for v in outside if not parameter.refusal(v)] == []
