"""The host's field of a seed: that of the format, whichever way a path crosses it."""

import math

import numpy as np
import pytest

from estimation.known_effects.random_field import random_field

AMPLITUDE, LENGTH, SEED = 0.2, 0.05, 7


def as_in_the_format(own, other):
    """docs/formats/effects.md, "The field of friction_map", at one point after the other."""
    generator = np.random.default_rng([0x4D4150, SEED])
    k = generator.normal(0.0, 1.0 / LENGTH, (2, 300))
    phase = generator.uniform(0.0, 2.0 * np.pi, 300)
    found = []
    for x, y in np.broadcast(own, other):
        normal = math.sqrt(2.0 / 300) * sum(np.cos(k[0] * x + k[1] * y + phase))
        found.append(1.0 + AMPLITUDE * math.erf(normal / math.sqrt(2.0)))
    return np.array(found)


@pytest.fixture
def factor():
    return random_field(AMPLITUDE, LENGTH, SEED)


def test_at_a_few_points_it_is_exact(factor):
    own, other = np.array([-0.1, 0.02, 0.13]), np.array([0.05, -0.07, 0.0])
    np.testing.assert_allclose(factor(own, other), as_in_the_format(own, other), atol=1e-12)


def test_along_a_dense_path_it_is_as_close_as_its_length_allows(factor):
    own = np.linspace(-0.1, 0.1, 400)
    other = 0.05 * np.sin(20.0 * own)
    expected = as_in_the_format(own, other)
    assert np.ptp(expected) > 0.1
    np.testing.assert_allclose(factor(own, other), expected, atol=2e-4)


def test_a_path_that_stands_still_has_one_value(factor):
    there = factor(np.full(50, 0.03), np.full(50, -0.02))
    np.testing.assert_allclose(there, as_in_the_format(0.03, -0.02)[0], atol=1e-12)
    assert factor(0.03, -0.02).shape == (1,)
