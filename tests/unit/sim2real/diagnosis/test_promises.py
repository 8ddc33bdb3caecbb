"""Which description a twin gets, and what moves that are all alike promise of others."""

from types import SimpleNamespace

import pytest

from sim2real.diagnosis.promises import (
    are_alike,
    find_simplest,
    have_one_speed,
    less_certain,
)
from sim2real.findings import ForceCurve, Unlisted
from stagectl.store import read_recording
from tests.unit.sim2real.conftest import DATA
from tests.unit.sim2real.test_phases import PERIOD, recording, swept


@pytest.mark.parametrize(
    ("left", "chosen"),
    [([10.0], 0), ([10.0, 9.0, 8.5], 0), ([10.0, 7.0, 6.0], 1), ([10.0, 7.0, 1.0], 2)],
)
def test_a_description_of_more_curves_has_to_close_clearly_more(left, chosen):
    assert find_simplest(left, gap=100.0) == chosen


PROGRAM = (0.0, 0.03, 0.01, -0.02)
"""Places of a short cycle [m]."""


@pytest.mark.parametrize(
    ("places", "alike"),
    [
        ((0.0, 0.03) * 4, True),
        (PROGRAM * 3, True),
        ((*PROGRAM, 0.02, *PROGRAM), False),
        ((0.0, 0.03, 0.01, -0.02, 0.015, -0.01, 0.04, -0.03), False),
    ],
)
def test_moves_of_a_short_program_are_alike(places, alike):
    assert are_alike(examined(recording(swept(places)))) is alike


def test_moves_of_a_recipe_are_not():
    assert not are_alike(examined(read_recording(DATA / "null-1.h5")))


def examined(recorded):
    replay = SimpleNamespace(recording=recorded, period=PERIOD)
    return SimpleNamespace(measured=[SimpleNamespace(replay=replay)])


def test_a_coordinate_of_moves_that_are_alike_is_less_certain():
    curve = ForceCurve((0.0, 1.0), (0.0, 1.0), (0.1, 0.1))
    found = less_certain(Unlisted("x", "position", (), 0.9, 0.95, (0.9, 0.97), curve))
    assert found.probability == 0.45
    assert found.gap_closed_interval == (0.45, 0.97)


@pytest.mark.parametrize(
    ("places", "one_speed"),
    [
        ((0.0, 0.03, 0.06, 0.09, 0.12), True),
        ((0.0, 0.03, -0.03, 0.03, 0.06), False),
        ((0.0, 0.03, 0.0300001, 0.06), True),
    ],
)
def test_strokes_of_equal_length_have_one_speed(places, one_speed):
    (axis,) = recording(swept(places)).axes
    assert have_one_speed(examined(recording(swept(places))), axis) is one_speed
