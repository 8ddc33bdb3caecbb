"""What moves that were left out say of an estimate, on the independent simulation."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.offline import identify
from estimation.offline.held_out import BETTER, NO_BETTER, UNTESTED, WORSE
from estimation.offline.uncertainty import ESTIMATED
from tests.unit.estimation.offline.test_identify import BELIEVED, SETTINGS, TS, drive

LOOSE = replace(SETTINGS, misfit=50.0)
"""Nothing is refused for its residual: what is left to refute an estimate is what it predicts."""


@pytest.fixture(scope="module")
def moves():
    return drive(14, 1)


@pytest.fixture(scope="module")
def rubbed(moves):
    """For a tenth of the time 2 N more rub against the stage; the prior is the truth elsewhere."""
    share = np.arange(len(moves.position)) / len(moves.position)
    velocity = np.gradient(moves.position, TS)
    more = np.where((share > 0.4) & (share < 0.5) & (np.abs(velocity) > 1e-4), 2.0, 0.0)
    force = moves.force + more * np.sign(velocity)
    return identify([replace(moves, force=force)], BELIEVED, LOOSE)


def test_a_figure_that_left_out_moves_refute_is_not_recommended(rubbed):
    assert rubbed["coulomb"].verdict == ESTIMATED
    assert rubbed["coulomb"].value > 7.0  # the truth is 6
    assert rubbed["coulomb"].held_out == WORSE
    assert "coulomb" not in rubbed.recommended


def test_nothing_is_recommended_where_all_together_predict_worse_than_the_priors(rubbed):
    assert rubbed.held_out > rubbed.before
    assert rubbed.recommended == {}


@pytest.fixture(scope="module")
def corrected(moves):
    """From a prior that is wrong in two figures."""
    return identify([moves], replace(BELIEVED, coulomb=4.5, viscous=30.0), SETTINGS)


def test_what_differs_from_the_prior_is_recommended_with_its_value(corrected):
    for name, truth in (("coulomb", 6.0), ("viscous", 20.0)):
        assert corrected[name].held_out == BETTER
        assert corrected.recommended[name] == pytest.approx(truth, rel=0.05)
    for name in corrected.recommended:
        assert corrected[name].held_out == BETTER, name


def test_only_what_the_moves_tell_of_the_friction_is_tested(corrected):
    for figure in corrected.figures:
        friction = figure.name in {
            "coulomb", "viscous", "stiffness", "relaxation_rate", "static_ratio",
            "stribeck_velocity", "stribeck_shape",
        }  # fmt: skip
        tested = figure.held_out in (BETTER, NO_BETTER, WORSE)
        assert tested == (friction and figure.verdict == ESTIMATED), figure.name


def test_too_few_moves_leave_estimates_untested_and_recommend_nothing():
    found = identify([drive(6, 1)], BELIEVED, LOOSE)
    assert found.reason is None
    assert np.isnan(found.held_out)
    assert {figure.held_out for figure in found.figures} == {UNTESTED}
    assert found.recommended == {}
