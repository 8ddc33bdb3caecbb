"""From an estimate to a measurement of the level."""

import pytest

from stagectl.history import measured_level, misfit_error
from tests.unit.stagectl.maps.conftest import estimate


def test_little_sliding_and_misfit_widen_a_measurement():
    """A move that hardly slid, and one that the model does not explain, say less of the level."""
    assert measured_level(estimate(None, "B", 0.4)) is None
    sigmas = [
        measured_level(estimate((6.0, 0.02), zones, misfit))[1]
        for zones, misfit in (("AB", 0.6), ("AB", 1.5), ("B", 0.4), ("B", 1.5))
    ]
    assert sigmas[0] == sigmas[1] == 0.02
    assert 0.02 < 3 * sigmas[2] < sigmas[3]
    assert [
        misfit_error(estimate((6.0, 0.02), zones, misfit)) > 0.0
        for zones, misfit in (("AB", 0.6), ("AB", 1.5), ("B", 1.5))
    ] == [False, True, False]


def test_after_a_jump_the_estimate_itself_is_the_measurement():
    """20 % up at once: not nothing, nor what a small change would mean."""
    for shown in (None, (9.0, 0.05)):
        assert measured_level(estimate(shown, level=1.2)) == pytest.approx((7.2, 0.06))
    assert measured_level(estimate((6.2, 0.05), level=1.02)) == (6.2, 0.05)
    assert measured_level(estimate(None, level=1.2, accepted=False)) is None
    assert measured_level(estimate(None, "B", level=1.2)) is None
