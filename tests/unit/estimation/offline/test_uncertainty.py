"""Verdicts, and sigma by noise or by the blocks' disagreement."""

import numpy as np
import pytest

from estimation.offline.fit import Fit
from estimation.offline.uncertainty import (
    BOUND,
    ESTIMATED,
    PRIOR,
    TOGETHER,
    find_prior_sigma,
    find_sigma,
    judge,
)
from estimation.offline.unknowns import COULOMB, FIGURES, MASS, VISCOUS, unknowns
from stagedata import FrictionFigures

U = unknowns(FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0), 8.0, 1e-3)
N, FIRST = len(U.mean), len(FIGURES)
PRIOR_SIGMA = find_prior_sigma(U)


def verdicts(sigma=0.1, q=U.mean, free=None, weak=()):
    sigmas = sigma * PRIOR_SIGMA
    sigmas[list(weak)] = PRIOR_SIGMA[list(weak)]
    return judge(U, q, sigmas, PRIOR_SIGMA, np.ones(N, dtype=bool) if free is None else free)


def test_a_figure_is_estimated_where_it_gains_a_factor_of_sqrt_two():
    assert set(verdicts(sigma=0.70)) == {ESTIMATED}
    assert set(verdicts(sigma=0.71)) == {PRIOR}


def test_what_was_not_solved_for_stays_at_its_prior():
    free = np.ones(N, dtype=bool)
    free[MASS] = False
    assert verdicts(free=free)[MASS] == PRIOR


def test_a_figure_on_its_bound_is_refused():
    q = U.mean.copy()
    q[COULOMB] = U.upper[COULOMB]
    assert verdicts(q=q)[COULOMB] == BOUND
    q[VISCOUS] = U.lower[VISCOUS]
    assert verdicts(q=q)[VISCOUS] == BOUND


def test_the_shape_is_determined_as_a_whole_or_not():
    one = verdicts(weak=[FIRST])
    assert one[FIRST] == TOGETHER
    assert set(one[FIRST + 1 :]) == {ESTIMATED}
    most = verdicts(weak=range(FIRST, FIRST + 5))
    assert set(most[FIRST:]) == {PRIOR}
    assert most[COULOMB] == ESTIMATED


def fit(scores, chi=100.0):
    covariance = np.diag(np.full(N, 1e-4))
    return Fit(U.mean, covariance, scores, np.zeros(len(scores)), chi, 100, ())


def test_sigma_is_that_of_noise_widened_where_the_residual_is_above_it():
    few = np.zeros((2, N))
    assert find_sigma(U, fit(few))[COULOMB] == pytest.approx(6.0 * 1e-2)
    assert find_sigma(U, fit(few, chi=400.0))[COULOMB] == pytest.approx(6.0 * 2e-2)
    assert find_sigma(U, fit(few, chi=25.0))[COULOMB] == pytest.approx(6.0 * 1e-2)


def test_blocks_that_disagree_by_more_than_noise_decide():
    scores = np.zeros((8, N))
    scores[:, COULOMB] = np.tile([300.0, -300.0], 4)
    by_noise, by_blocks = 6.0 * 1e-2, 6.0 * 1e-4 * 300.0 * 8.0 / np.sqrt(7.0)
    assert by_blocks > by_noise
    assert find_sigma(U, fit(scores))[COULOMB] == pytest.approx(by_blocks)
    # Fitted to the same blocks, many unknowns leave fewer of them free to disagree.
    assert find_sigma(U, fit(scores), shared=True)[COULOMB] > 1.5 * by_blocks
    assert find_sigma(U, fit(scores))[VISCOUS] == pytest.approx(20.0 * 1e-2)
