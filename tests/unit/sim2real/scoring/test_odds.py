"""Probabilities of effects, by the scores of sets of effects."""

from __future__ import annotations

import math

import pytest

from sim2real.scoring import weigh_effect

FAR = 60.0
"""Score by which a set is out of the question."""


def test_an_effect_is_as_probable_as_the_sets_that_have_it():
    scores = {("a", "b"): 0.0, ("a",): 2.0, ("b",): FAR, (): FAR}
    sure, _ = weigh_effect(scores, ("a", "b"), "a")
    less, _ = weigh_effect(scores, ("a", "b"), "b")
    assert sure == pytest.approx(1.0, abs=1e-9)
    assert less == pytest.approx(1.0 / (1.0 + math.exp(-1.0)), abs=1e-9)


def test_the_chosen_effects_count_for_half_at_least():
    """The simplest set may have been chosen although others score as well, or a little better."""
    scores = {("a",): 3.0, ("b",): 0.0, ("c",): 0.0}
    probability, others = weigh_effect(scores, ("a",), "a")
    assert 0.5 < probability < 0.55
    assert set(others) == {"b", "c"}


def test_only_an_exchange_of_one_effect_takes_its_place():
    scores = {("a", "b"): 0.0, ("a", "c"): 1.0, ("c",): 1.0, ("c", "d"): 1.0, ("b", "c", "d"): 1.0}
    assert weigh_effect(scores, ("b", "a"), "b")[1] == ["c"]
    assert weigh_effect(scores, ("b", "a"), "a")[1] == []


def test_what_is_improbable_is_no_rival():
    assert weigh_effect({("a",): 0.0, ("b",): 7.0}, ("a",), "a")[1] == []
    assert weigh_effect({("a",): 0.0, ("b",): 5.0}, ("a",), "a")[1] == ["b"]
