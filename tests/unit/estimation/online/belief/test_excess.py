"""How much acts beside the model, as moves show it."""

import numpy as np
import pytest

from estimation.online.belief.excess import LEAST_UNMODELLED, learn_excess
from estimation.online.estimator import SplitHorizonEstimator
from tests.unit.estimation.online.moves import TRUE
from tests.unit.estimation.online.test_unmodelled_force import AS_IN_A_RUN

NOTHING = (0.0, 0.0)


def start():
    return SplitHorizonEstimator(TRUE, AS_IN_A_RUN)._axis, np.array([1.0, 0.3, 0.3])  # noqa: SLF001


def test_a_move_that_says_nothing_of_a_force_leaves_it_as_it_was():
    axis, weights = start()
    before = axis["wander"], axis["unmodelled"]
    learn_excess(axis, weights, 0.0, NOTHING, NOTHING, 1.0, 15)
    assert (axis["wander"], axis["unmodelled"]) == pytest.approx(before)
    np.testing.assert_array_equal(weights[1:], 0.3)


def test_moves_that_agree_show_what_is_there():
    axis, weights = start()
    for _ in range(200):
        learn_excess(axis, weights, 0.05**2, (0.02**2, 1.0), (0.2**2, 1.0), 1.0, 15)
    assert axis["model_error"] == pytest.approx(0.05, rel=1e-3)
    assert axis["wander"] == pytest.approx(0.02, rel=1e-3)
    assert axis["unmodelled"] == pytest.approx(0.2, rel=1e-3)
    usual = AS_IN_A_RUN.model_error**2 + AS_IN_A_RUN.belief.wander**2
    assert axis["excess"] ** 2 == pytest.approx(0.05**2 + 0.02**2 + 0.2**2 - usual, rel=1e-3)
    np.testing.assert_array_equal(weights, 15.0)


def test_nothing_falls_below_what_is_known_beforehand():
    axis, weights = start()
    for _ in range(200):
        learn_excess(axis, weights, 0.0, (0.0, 1.0), (0.0, 1.0), 1.0, 15)
    assert axis["model_error"] == AS_IN_A_RUN.model_error
    assert axis["wander"] == AS_IN_A_RUN.belief.wander
    assert axis["unmodelled"] == LEAST_UNMODELLED
    assert axis["excess"] == pytest.approx(LEAST_UNMODELLED)
