"""When a move counts as one that shows the sliding level by itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from estimation.online.estimate import Estimate
from stagedata import FrictionFigures

FACTS = (
    FrictionFigures(4, 8.0, 12.0, 1.5e6, 250.0, 0.3, 2e-3, 1.0),
    8.0,
    1e-3,
)


def shown(variance, variance_before):
    """Level [N] and sigma as a move shows it that found 1.02 where 1 was expected, relative."""
    sliding = np.array([1.0, variance_before, 1.02, variance])
    return Estimate(SimpleNamespace(sliding=sliding), FACTS).shown


def test_what_was_believed_before_is_taken_out_again():
    level, sigma = shown(1e-4, 4e-4)
    share = 4.0 / 3.0
    assert level == pytest.approx(8.0 * (1.0 + 0.02 * share))
    assert sigma == pytest.approx(8.0 * 0.01 * share**0.5)


def test_a_move_that_leaves_more_than_half_of_the_variance_shows_nothing():
    assert shown(0.48e-4, 1e-4) is not None
    assert shown(0.52e-4, 1e-4) is None


def test_nor_does_one_that_leaves_the_level_uncertain_by_more_than_1_5_percent():
    assert shown((0.0148 * 1.02) ** 2, 10.0) is not None
    assert shown((0.0152 * 1.02) ** 2, 10.0) is None
