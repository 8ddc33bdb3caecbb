"""Which description a twin gets."""

import pytest

from sim2real.diagnosis.promises import find_simplest


@pytest.mark.parametrize(
    ("left", "chosen"),
    [([10.0], 0), ([10.0, 9.0, 8.5], 0), ([10.0, 7.0, 6.0], 1), ([10.0, 7.0, 1.0], 2)],
)
def test_a_description_of_more_curves_has_to_close_clearly_more(left, chosen):
    assert find_simplest(left, gap=100.0) == chosen
