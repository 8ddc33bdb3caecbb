"""Does a node behave as CiA 301 and CiA 402 say? Checks against any CANopen drive, as findings.

Needs no EDS: objects are read and written by SDO with the sizes that CiA 402 gives them. Every
value that is changed is put back, and the drive ends disabled and PRE-OPERATIONAL. The axis comes
under force where it stands (`power`) and isn't moved: set-points are its actual position. What a
drive may do without is "not offered", not a failure; a refusal with another abort code than the
standard's is "differs".
"""

from __future__ import annotations

from drivers.bench.conformance.examination import run
from drivers.bench.conformance.probe import Finding, Probe, Verdict

__all__ = ["Finding", "Probe", "Verdict", "run"]
