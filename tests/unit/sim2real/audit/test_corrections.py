"""Channels corrected for what was found on them."""

import numpy as np

from sim2real.audit import remove_delay
from sim2real.audit.corrections import rescale
from sim2real.findings import ChannelFinding
from tests.unit.sim2real.audit.conftest import spoilt


def test_factors_and_offsets_are_taken_out(recorded):
    found = [
        ChannelFinding("x", "force_actual", "sign", -1.0, "1"),
        ChannelFinding("x", "position_actual", "offset", 2e-5, "m"),
    ]
    wrong = spoilt(recorded, force_actual=lambda f: -f, position_actual=lambda y: y + 2e-5)
    right = rescale(wrong, found)
    np.testing.assert_array_equal(right.axes["x"].force_actual, recorded.axes["x"].force_actual)
    np.testing.assert_allclose(
        right.axes["x"].position_actual, recorded.axes["x"].position_actual, atol=1e-15
    )
    assert right.axes["y"] is wrong.axes["y"]


def test_moves_follow_the_unit_of_the_demand(recorded):
    wrong = spoilt(recorded, position_demand=lambda d: 1e3 * d)
    unit = ChannelFinding("x", "position_demand", "units", 1e3, "1")
    right = rescale(wrong, [unit])
    assert right.moves[0].target["x"] == recorded.moves[0].target["x"] / 1e3


def test_a_delay_of_whole_samples_leaves_the_last_ones_invalid(recorded):
    late = spoilt(recorded, force_actual=lambda f: np.concatenate((np.repeat(f[:1], 2), f[:-2])))
    right = remove_delay(late, "x", "force_actual", 2e-3, 1e-3).axes["x"]
    np.testing.assert_array_equal(right.force_actual[:-2], recorded.axes["x"].force_actual[:-2])
    assert right.valid[:-2].all()
    assert not right.valid[-2:].any()
