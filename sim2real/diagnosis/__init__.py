"""The whole diagnosis of a sim-to-real gap.

`examination` comes first: channels, floor, gap and its location. `procedure` then searches the axes
for effects, and `verdict` draws the conclusions into a `GapReport`. Without a demand or a known
controller, `open_loop` does both along the measured motion. `other_recordings` validates the
result on recordings that took no part, and `clock` says when each recording began.
"""

from sim2real.diagnosis.clock import continue_clock
from sim2real.diagnosis.examination import PHASES, Examination, Progress, examine
from sim2real.diagnosis.other_recordings import examine_others, judge_elsewhere
from sim2real.diagnosis.procedure import diagnose
from sim2real.diagnosis.verdict import Diagnosis

__all__ = [
    "PHASES",
    "Diagnosis",
    "Examination",
    "Progress",
    "continue_clock",
    "diagnose",
    "examine",
    "examine_others",
    "judge_elsewhere",
]
