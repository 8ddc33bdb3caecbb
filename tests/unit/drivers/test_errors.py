"""Error messages: one line that names axis, object and cause."""

import numpy as np
import pytest

from drivers.drive import Mode
from drivers.errors import AxisFault, BusError, DriverError, HomingError, NodeError, shown
from drivers.objects import ObjectRef


@pytest.mark.parametrize(
    ("value", "text"),
    [(Mode.HOMING, "6"), (np.float64(0.5), "0.5"), (b"\x01\xff", "01 FF"), ("a", '"a"')],
)
def test_values_are_formatted_for_people(value, text):
    assert shown(value) == text


def test_errors_name_axis_object_cause_in_one_line():
    problem = AxisFault("went wrong", axis="x", obj=ObjectRef(0x6065, 2, "window"), code=7)
    assert str(problem) == "axis x: 0x6065:02 window: went wrong"
    assert (problem.axis, problem.cause, problem.code) == ("x", "went wrong", 7)
    assert str(BusError("bus can0: gone")) == "bus can0: gone"
    assert str(NodeError("silent", axis="y")) == "axis y: silent"
    assert issubclass(HomingError, AxisFault)
    assert issubclass(AxisFault, DriverError)
