"""How belief ages, and what prior a solve gets of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from estimation.online import BeliefSettings, EstimatorSettings
from estimation.online.belief.arrival_cost import age, decay, joint_prior, knots_of, take_over
from estimation.online.belief.belief import COULOMB, KNOTS, LEVEL, MASS, VISCOUS, Belief
from stagedata import FrictionFigures

START = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SETTINGS = EstimatorSettings(8.0, 1e-3, 1e-9, 0.0115)
AXIS = SETTINGS.axis(START)
WITHOUT_WANDER = replace(SETTINGS, belief=BeliefSettings(wander=0.0))


def belief():
    made = Belief.at_start(SETTINGS.belief, START)
    made.mean[LEVEL] = 0.02
    made.covariance[COULOMB, LEVEL] = made.covariance[LEVEL, COULOMB] = -1e-3
    return made


def test_figures_drift_and_the_level_decays():
    old = belief()
    mean, covariance = age(old, 0.5, 0.0, AXIS)
    keep = math.exp(-1.0)
    assert mean[LEVEL] == pytest.approx(0.02 * keep)
    assert covariance[COULOMB, LEVEL] == pytest.approx(-1e-3 * keep)
    np.testing.assert_allclose(
        np.diag(covariance)[:LEVEL], np.diag(old.covariance)[:LEVEL] + AXIS["drift"] ** 2
    )


def test_a_level_left_alone_is_that_of_the_machine_file():
    old = belief()
    decay(old, 200.0, 0.0, AXIS)
    assert old.mean[LEVEL] == pytest.approx(0.0, abs=1e-12)
    assert old.covariance[LEVEL, LEVEL] == pytest.approx(SETTINGS.belief.wander**2, rel=1e-6)


def test_the_knots_of_the_level_are_one_gauss_markov_process():
    old, knots = belief(), 4
    old.covariance[COULOMB, LEVEL] = old.covariance[LEVEL, COULOMB] = 0.0
    chosen = np.array([COULOMB, VISCOUS, KNOTS, KNOTS + 1, KNOTS + 2, KNOTS + 3])
    prior, information = joint_prior(old, chosen, 2, knots, 0, 0.6, 0.0, AXIS)
    covariance = np.linalg.inv(information)
    keep = math.exp(-0.1 / 0.5)
    np.testing.assert_allclose(prior[2:], 0.02 * keep ** np.arange(4))
    apart = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
    np.testing.assert_allclose(covariance[2:, 2:], 1e-4 * keep**apart, rtol=1e-5)
    np.testing.assert_allclose(covariance[:2, :2], old.covariance[:2, :2], atol=1e-12)


def test_no_wander_no_knots():
    assert knots_of(0.6, WITHOUT_WANDER.axis(START)) == 0
    assert knots_of(0.6, AXIS) == 4


def test_what_was_not_solved_for_keeps_its_belief():
    old = belief()
    p = np.zeros(KNOTS)
    p[COULOMB] = 1.5
    new = belief()
    take_over(p, np.array([[0.01]]), np.array([COULOMB]), 1, 0, 0, old, new)
    mean, covariance = new
    assert mean[COULOMB] == 1.5
    assert covariance[COULOMB, COULOMB] == 0.01
    assert mean[MASS] == old.mean[MASS]
    assert covariance[MASS, MASS] == old.covariance[MASS, MASS]
