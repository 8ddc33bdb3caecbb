"""The whole diagnosis of a sim-to-real gap.

`examination` comes first: channels, floor, gap and its location. `procedure` then searches the axes
for effects, and `verdict` draws the conclusions into a `GapReport`. Without a demand or a known
controller, `open_loop` does both along the measured motion. `other_recordings` validates the
result on recordings that took no part, and `clock` says when each recording began.
"""

from sim2real.diagnosis.clock import continue_clock as continue_clock
from sim2real.diagnosis.examination import PHASES as PHASES
from sim2real.diagnosis.examination import Examination as Examination
from sim2real.diagnosis.examination import Progress as Progress
from sim2real.diagnosis.examination import examine as examine
from sim2real.diagnosis.other_recordings import examine_others as examine_others
from sim2real.diagnosis.other_recordings import judge_elsewhere as judge_elsewhere
from sim2real.diagnosis.procedure import diagnose as diagnose
from sim2real.diagnosis.verdict import Diagnosis as Diagnosis
