"""Measures how a stage answers to force offsets and to its demand, for the settling observer.

`experiment` shakes the stage within stated limits, `document` is the measurement and its file,
`procedure` makes one of an enabled stage, `simulated` of a virtual one.
"""

from stagectl.measurement.document import (
    SUFFIX,
    Measurement,
    load_measurement,
    parse_measurement,
    response_path,
)
from stagectl.measurement.findings import AxisFindings, find_contradictions
from stagectl.measurement.procedure import identify, measure_on_bus
from stagectl.measurement.simulated import measure_simulated, measure_virtual_stage

__all__ = [
    "SUFFIX",
    "AxisFindings",
    "Measurement",
    "find_contradictions",
    "identify",
    "load_measurement",
    "measure_on_bus",
    "measure_simulated",
    "measure_virtual_stage",
    "parse_measurement",
    "response_path",
]
