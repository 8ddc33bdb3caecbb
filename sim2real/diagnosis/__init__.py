"""The whole diagnosis of a sim-to-real gap.

`examination` comes first: channels, floor, gap and its location. `procedure` then searches the axes
for effects, and `verdict` draws the conclusions into a `GapReport`.
"""

from sim2real.diagnosis.examination import (
    PHASES,
    Examination,
    Progress,
    examine,
    report_without_causes,
    why_insufficient,
)
from sim2real.diagnosis.procedure import diagnose
from sim2real.diagnosis.verdict import Diagnosis

__all__ = [
    "PHASES",
    "Diagnosis",
    "Examination",
    "Progress",
    "diagnose",
    "examine",
    "report_without_causes",
    "why_insufficient",
]
