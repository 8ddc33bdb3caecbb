"""The similarity of signatures."""

import numpy as np
import pytest

from sim2real.attribution import signature_similarity


def test_similarity_is_the_absolute_cosine():
    signatures = {
        "one": np.array([1.0, 0.0]),
        "other": np.array([-3.0, 4.0]),
        "across": np.array([0.0, 2.0]),
    }
    pairs = signature_similarity(signatures, list(signatures))
    assert pairs == {
        ("one", "other"): pytest.approx(0.6),
        ("one", "across"): pytest.approx(0.0),
        ("other", "across"): pytest.approx(0.8),
    }


def test_effects_without_a_signature_are_left_out():
    signatures = {"one": np.ones(2), "none": np.zeros(2), "diverged": np.full(2, np.inf)}
    assert signature_similarity(signatures, [*signatures, "unknown"]) == {}
