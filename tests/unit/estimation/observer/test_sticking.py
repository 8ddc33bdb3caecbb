"""Whether an axis at rest gives way to a change of force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimation.observer import sticks, without_presliding
from estimation.observer.design import design_observer
from tests.unit.estimation.observer.axes import CARRIAGE, FIGURES

DESIGN = design_observer(FIGURES)
STILL = np.ones(100, np.bool_)
RISING = np.linspace(0.0, 20.0, 100)
"""Force: in 20 samples by two thirds of the Coulomb force [N]."""
NOISE = np.random.default_rng(1).normal(0.0, 1e-9, 100)


def test_it_does_not_where_it_sticks():
    assert sticks(DESIGN, NOISE, RISING, STILL)


@pytest.mark.parametrize("stiffer", [0.5, 1.0, 5.0])
def test_it_does_by_a_spring(stiffer):
    position = RISING / (stiffer * CARRIAGE.stiffness)
    assert not sticks(DESIGN, position + NOISE, RISING, STILL)


def test_a_coarse_encoder_does_not_show_whether_it_does():
    coarse = design_observer(replace(FIGURES, noise=1e-6 / 12.0**0.5))
    position = 1e-6 * np.round(RISING / CARRIAGE.stiffness / 1e-6)
    assert not sticks(coarse, position, RISING, STILL)


def test_while_an_axis_is_to_move_nothing_is_judged():
    moving = np.arange(100) % 20 != 7
    assert not sticks(DESIGN, NOISE, RISING, moving)


def test_small_changes_of_force_say_nothing():
    assert not sticks(DESIGN, NOISE, RISING / 3.0, STILL)


def test_a_stretch_shorter_than_a_look_says_nothing():
    assert not sticks(DESIGN, NOISE[:19], 10.0 * RISING[:19], STILL[:19])


def test_the_other_design_assumes_no_spring():
    other = without_presliding(DESIGN)
    assert other.assumed_stiffness == 0.0
    assert other.gain >= DESIGN.gain
    assert other.worst_peak <= 2.0
