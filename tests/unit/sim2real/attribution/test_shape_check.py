"""Effects in another shape, and when two effects are one profile."""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.attribution.shape_check import Repeat, are_harmonics, free_form_repeat, is_one_profile
from sim2real.fitting import NUISANCES, AxisModel, Term
from tests.unit.sim2real.conftest import Nominal

BELL = library()["friction_position"]
LEVEL = library()["coulomb_level"]


def model(*terms: Term) -> AxisModel:
    return AxisModel(np.zeros(NUISANCES), terms)


@pytest.mark.parametrize(
    ("effect", "shapes", "harmonic"),
    [
        ("cogging", (0.030, 0.0151, 0.0100), True),
        ("cogging", (0.046, 0.145), False),  # any force over position is a sum of waves
        ("floor_vibration", (25.0, 50.1), True),
        ("floor_vibration", (25.0, 40.0), False),
        ("friction_position", (0.01, 0.025), True),  # no waves
    ],
)
def test_waves_are_of_one_family_if_they_are_harmonics(
    effect: str, shapes: tuple[float, ...], harmonic: bool
) -> None:
    known = library()[effect]
    at = next(i for i, p in enumerate(known.parameters) if p.role == "shape")
    terms = [
        Term(known, tuple(shape if i == at else 0.5 for i in range(len(known.parameters))))
        for shape in shapes
    ]
    assert are_harmonics(model(*terms), terms[0]) is harmonic


@pytest.mark.parametrize(
    ("left", "one"),
    [((100.0, 160.0), True), ((100.0, 90.0), False), ((60.0, 20.0), False)],
)
def test_a_level_against_a_bell_is_one_profile_where_either_alone_opens_the_loop(
    nominal: Nominal, left: tuple[float, float], one: bool
) -> None:
    axis = nominal[1].axes[0]
    both = model(Term(LEVEL, (0.8,)), Term(BELL, (0.4, 0.0, 0.03)))

    def loop(tried: AxisModel) -> float:
        return left[tried.names() == ("coulomb_level",)]

    assert is_one_profile(both, 100.0, axis, loop) is one
    assert not is_one_profile(both.without(0), 100.0, axis, loop)


@pytest.mark.parametrize(
    ("shares", "gaps", "departs", "closed"),
    [
        ((0.3, 0.8), (202.0, 102.0), True, 22.0),  # what the nearest one leaves is of its kind
        ((0.9, 0.4), (102.0, 52.0), True, 12.0),  # what the machine file leaves is
        ((0.9, 0.8), (102.0, 4.0), False, 2.4),  # the nearest one leaves nothing
        ((0.4, 0.3), (102.0, 52.0), False, 37.0),  # it is of another kind
        ((1.0, 1.0), (102.0, 52.0), True, 2.0),
    ],
)
def test_a_form_of_its_own_departs_where_more_than_noise_is_left(
    shares: tuple[float, float], gaps: tuple[float, float], departs: bool, closed: float
) -> None:
    found = free_form_repeat(model(Term(BELL, (0.4, 0.0, 0.03))), shares, gaps)
    assert found.departs is departs
    assert found.gap == pytest.approx(closed)


@pytest.mark.parametrize(
    ("gap", "before", "share", "family"),
    [
        (5.0, 20.0, 0.9, True),
        (60.0, 80.0, 0.9, False),  # of its kind, but most of the gap is something else
        (5.0, 120.0, 0.9, False),  # the library's nearest opens the loop
        (5.0, 20.0, 0.1, False),
    ],
)
def test_a_family_closes_most_of_the_gap(
    gap: float, before: float, share: float, family: bool
) -> None:
    repeat = Repeat(0.0, share, 1e4, gap, before, model())
    assert repeat.is_family(100.0) is family
