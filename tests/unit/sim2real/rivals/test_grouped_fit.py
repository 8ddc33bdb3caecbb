"""Least squares of curves and figures, each group predicted by the others."""

import numpy as np
import pytest

from sim2real.rivals.grouped_fit import GroupedFit


@pytest.mark.parametrize(("moved", "expected"), [(2.0, 2.0), (40.0, 5.0)])
def test_figures_end_at_their_bounds_even_all_of_them(moved, expected):
    """One figure alone, as many sigmas off: it is fitted, or stays five off."""
    rng = np.random.default_rng(1)
    column = rng.standard_normal(400)
    residual = -moved * column
    turn = np.arange(400) // 50
    fit = GroupedFit(
        np.column_stack((column, residual)), turn % 4, turn, (4, 8), 0, np.zeros(1), 1e-6
    )
    found = fit.judged([np.empty((0, 0))])
    assert found.values == pytest.approx([expected])
