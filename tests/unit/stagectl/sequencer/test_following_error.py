"""The host's watch over the following error."""

from dataclasses import replace

import numpy as np
import pytest

from stagectl.errors import RunFault
from stagectl.sequencer.following_error import FAULT_SAMPLES, check_following_error
from stagedata import Samples

COUNT = 60
DEMAND = np.column_stack([np.linspace(0.0, 0.01, COUNT), np.zeros(COUNT)])


def watched(outside, invalid=0):
    """Axis y is 2 mm off its demand in this many samples; the first of them invalid."""
    position = np.vstack([DEMAND[:1], DEMAND[:-1]])
    position[20 : 20 + outside, 1] += 2e-3
    valid = np.ones((COUNT, 2), dtype=bool)
    valid[20 : 20 + invalid, 1] = False
    samples = replace(Samples.missing(COUNT, 2), position=position, valid=valid)
    check_following_error(samples, DEMAND, ("x", "y"), (1e-3, 1e-3))


def test_position_is_compared_with_the_demand_of_the_sample_before():
    watched(0)


def test_a_few_samples_outside_the_window_are_no_fault():
    watched(FAULT_SAMPLES - 1)
    watched(FAULT_SAMPLES + 4, invalid=5)


def test_the_fault_names_axis_object_and_window():
    with pytest.raises(RunFault, match=r"axis y: 0x6064:00 .* 2 mm .*following_error: 1 mm"):
        watched(FAULT_SAMPLES)
