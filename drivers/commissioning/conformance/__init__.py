"""Conformance of any CANopen drive to CiA 301 and CiA 402.

Needs no EDS: objects are read and written by SDO with the sizes of CiA 402. Changed values are
restored, and the drive ends disabled and PRE-OPERATIONAL. With `power` the axis is enabled where it
stands and not moved: setpoints are its actual position. A missing optional feature is "not
offered", a refusal with an abort code other than the standard's "differs"; neither is a failure.
"""

from drivers.commissioning.conformance.examination import run as run
from drivers.commissioning.conformance.probe import Finding as Finding
from drivers.commissioning.conformance.probe import Verdict as Verdict
