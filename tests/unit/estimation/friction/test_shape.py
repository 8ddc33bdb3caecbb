"""What the shape of the hysteresis leaves open of sigma0."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from estimation.friction.shape import stiffness_doubt


def curve(elements, displacement):
    """Force over Fs by the law's equations, one element after another."""
    total = np.zeros_like(displacement)
    for i in range(1, elements + 1):
        total += np.minimum(displacement / elements, 2.0 * i / (elements * (elements + 1)))
    return total


@pytest.mark.parametrize("elements", [2, 4, 10, 20])
def test_it_is_the_largest_deviation_among_all_numbers(elements):
    """Of a fit that knows nothing else, where any misfit passes."""
    places = np.linspace(0.0, 2.0, 201)

    def off(other):
        seen = curve(other, places)
        fitted = minimize_scalar(
            lambda s: float(np.sum((curve(elements, s * places) - seen) ** 2)),
            bounds=(0.5, 2.0), method="bounded",
        )  # fmt: skip
        return abs(fitted.x - 1.0)

    largest = max(off(1), off(64))
    assert stiffness_doubt(elements, 1.0) == pytest.approx(largest / math.sqrt(3.0), rel=0.01)


def test_a_model_that_misses_nothing_leaves_nothing_open():
    assert stiffness_doubt(10, 0.0) == 0.0
    doubts = [stiffness_doubt(10, error) for error in (0.002, 0.005, 0.01, 0.02, 0.05)]
    assert np.all(np.diff(doubts) > 0.0)


@pytest.mark.parametrize("elements", [1, 2, 64])
def test_every_number_of_elements_has_one(elements):
    assert 0.0 < stiffness_doubt(elements, 0.007) < 0.3
