"""Measures how a stage answers to force offsets and to its demand, for the settling observer.

`experiment` shakes the stage within stated limits, `document` is the measurement and its file,
`procedure` makes one of an enabled stage, `simulated` of a virtual one. `scale` compares scale and
sign of a drive's numbers by a short move.
"""

from stagectl.measurement.document import SUFFIX as SUFFIX
from stagectl.measurement.document import Measurement as Measurement
from stagectl.measurement.document import load_measurement as load_measurement
from stagectl.measurement.document import parse_measurement as parse_measurement
from stagectl.measurement.document import response_path as response_path
from stagectl.measurement.findings import AxisFindings as AxisFindings
from stagectl.measurement.findings import find_contradictions as find_contradictions
from stagectl.measurement.learned import facts_of_response as facts_of_response
from stagectl.measurement.learned import facts_of_scale as facts_of_scale
from stagectl.measurement.procedure import identify as identify
from stagectl.measurement.procedure import measure_on_bus as measure_on_bus
from stagectl.measurement.procedure import measure_stage as measure_stage
from stagectl.measurement.scale import Compared as Compared
from stagectl.measurement.scale import check_scale as check_scale
from stagectl.measurement.scale import never_checked as never_checked
from stagectl.measurement.scale import note_checked as note_checked
from stagectl.measurement.simulated import measure_simulated as measure_simulated
from stagectl.measurement.simulated import measure_virtual_stage as measure_virtual_stage
