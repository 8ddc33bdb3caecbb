"""Nodes of curves over coordinates of the motion."""

import numpy as np
import pytest

from sim2real.rivals.coordinates import Coordinate, Course, nodes


@pytest.mark.parametrize(
    "values", [np.linspace(-0.1, 0.4, 50), np.linspace(0.02, 0.4, 50), np.linspace(-0.4, -0.02, 50)]
)
@pytest.mark.parametrize("over", ["velocity", "force", "acceleration"])
def test_nodes_increase_also_where_an_axis_goes_one_way_only(values, over):
    at = nodes(Coordinate(over, over), [Course({over: values}, None, 0.9, 1e-3, 1.0, 1.0)])
    assert (np.diff(at) > 0.0).all()
    assert at[len(at) // 2] == 0.0
    assert at[0] <= values.min()
    assert at[-1] >= values.max()
