"""The blind check of the diagnosis: stages whose effects are drawn and sealed, then diagnosed.

Drawing (`moves`, `draw`, `stage`; `unlisted_effects` and `reserved_effects` beside the library)
knows the library's plausible ranges and the simulator, and nothing of how a diagnosis works. `seal`
commits to the answer, `trial` runs one diagnosis, `outcome` keeps what it said, `score` counts, and
`page` writes docs/blind.md.
"""

from sim2real.blind.draw import find_pool
from sim2real.blind.outcome import Outcome
from sim2real.blind.page import describe_reported, describe_truth, table_rows, write_page
from sim2real.blind.score import is_wrong, score_outcomes
from sim2real.blind.trial import Setup, draw_trial, run_trial

__all__ = [
    "Outcome",
    "Setup",
    "describe_reported",
    "describe_truth",
    "draw_trial",
    "find_pool",
    "is_wrong",
    "run_trial",
    "score_outcomes",
    "table_rows",
    "write_page",
]
