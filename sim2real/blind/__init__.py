"""The blind check of the diagnosis: stages whose effects are drawn and sealed, then diagnosed.

Drawing (`moves`, `draw`, `stage`; `unlisted_effects` and `reserved_effects` beside the library)
knows the library's plausible ranges and the simulator, and nothing of how a diagnosis works. `seal`
commits to the answer, `trial` runs one diagnosis, `outcome` keeps what it said, `score` counts, and
`page` writes docs/blind.md.
"""

from sim2real.blind.draw import find_pool as find_pool
from sim2real.blind.outcome import Outcome as Outcome
from sim2real.blind.page import describe_reported as describe_reported
from sim2real.blind.page import describe_truth as describe_truth
from sim2real.blind.page import table_rows as table_rows
from sim2real.blind.page import write_page as write_page
from sim2real.blind.score import is_wrong as is_wrong
from sim2real.blind.score import score_outcomes as score_outcomes
from sim2real.blind.trial import Setup as Setup
from sim2real.blind.trial import draw_trial as draw_trial
from sim2real.blind.trial import run_trial as run_trial
