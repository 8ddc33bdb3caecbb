"""Which probability the figures of an effect allow, and what a doubt says of the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.attribution.axis_search import AxisResult
from sim2real.attribution.causes import find_causes
from sim2real.fitting import NUISANCES, STEP, AxisModel, Fitted, Term, coordinates
from sim2real.scoring.constants import DOUBTED, UNCERTAIN


class Searched(AxisResult):
    """Every effect is probable, and needed where nothing is left."""

    def probability(self, effect):
        return 0.99, []

    def is_needed(self, term):
        return self.is_complete


class NotNeeded(Searched):
    """Effects that no score shows to be needed."""

    def is_needed(self, term):
        return False


class GivenBack:
    """What effects give back of the gap when they are removed."""

    def __init__(self, *shares, within=0.1):
        self.shares, self.within = shares, within

    def given_back(self, axis, index):
        share = self.shares[index]
        return share, (share - self.within, share + self.within)


@pytest.fixture
def searched(nominal):
    def make(sigmas, *terms):
        axis = nominal[1].axes[0]
        model = AxisModel(
            np.zeros(NUISANCES), tuple(Term(library()[name], values) for name, values in terms)
        )
        slopes = [
            abs(entry.slope(value))
            for term in model.terms
            for entry, value in zip(coordinates(term.effect, axis), term.values, strict=True)
        ]
        variances = np.square([s / slope for s, slope in zip(sigmas, slopes, strict=True)])
        covariance = np.diag([*np.ones(STEP), *variances])
        fitted = Fitted(model, 0.0, np.empty(0), covariance)
        return Searched(axis=axis, spread=np.ones(STEP), best=fitted)

    return make


def probabilities(result, *shares, **known):
    causes, _ = find_causes(result, GivenBack(*shares, **known), along_motion=True)
    return {cause.effect: cause.probability for cause in causes}


SPRING, PULL = ("cable_stiffness", (17.0, -0.02)), ("force_offset", (1.0,))


def test_what_is_needed_may_have_an_uncertain_size_unless_another_effect_is_doubted(searched):
    """A hose that pulls on one side was a spring of 17 +- 330 N/m beside a doubted cogging."""
    result = searched([330.0, 0.1, 0.01], SPRING, PULL)
    assert probabilities(result, 0.9, 0.5) == {"cable_stiffness": 0.99, "force_offset": 0.99}
    doubted = probabilities(result, 0.9, 0.05)
    assert doubted == {"cable_stiffness": DOUBTED, "force_offset": DOUBTED}
    sure = searched([1.0, 0.001, 0.01], SPRING, PULL)
    assert probabilities(sure, 0.9, 0.05) == {"cable_stiffness": UNCERTAIN, "force_offset": DOUBTED}


def test_an_effect_that_alone_explains_the_axis_may_have_figures_known_together_only(searched):
    """Friction of a gear: of its ratio and the motor's share of the mass only a product counts."""
    made = searched([0.1, 0.3], ("load_friction", (0.145, 0.48)))
    result = NotNeeded(axis=made.axis, spread=made.spread, best=made.best)
    assert probabilities(result, 0.9) == {"load_friction": 0.99}
    assert probabilities(result, 0.5) == {"load_friction": DOUBTED}


def test_a_level_of_friction_and_a_shape_that_is_not_seen_are_less_sure(searched):
    level = searched([0.001], ("coulomb_level", (1.2,)))
    assert probabilities(level, 0.9) == {"coulomb_level": UNCERTAIN}
    for sigma, expected in ((5.0, 0.99), (4000.0, UNCERTAIN)):
        drift = searched([0.01, sigma], ("thermal_drift", (0.2, 50.0)))
        assert probabilities(drift, 0.9) == {"thermal_drift": expected}


def test_what_gives_back_next_to_nothing_is_doubted_where_structure_is_left(searched):
    found = searched([0.1, 0.1, 0.001], SPRING, PULL)
    named = {"cable_stiffness": 0.99, "force_offset": 0.99}
    assert probabilities(found, 0.98, 0.01, within=0.005) == named
    left = replace(found, is_complete=False)
    doubted = {"cable_stiffness": UNCERTAIN, "force_offset": DOUBTED}
    assert probabilities(left, 0.98, 0.01, within=0.005) == doubted


@pytest.mark.parametrize(("sigma", "probability"), [(0.4, UNCERTAIN), (0.6, DOUBTED)])
def test_a_size_within_two_sigmas_of_zero_is_doubted(searched, sigma, probability):
    pull = replace(searched([sigma], PULL), is_complete=False)
    assert probabilities(pull, 0.9) == {"force_offset": probability}
