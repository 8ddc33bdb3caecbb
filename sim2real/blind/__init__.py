"""The blind check of the diagnosis: stages whose effects are drawn and sealed, then diagnosed.

Drawing (`moves`, `draw`, `stage`; `unlisted_effects` and `reserved_effects` beside the library)
knows the library's plausible ranges and the simulator, and nothing of how a diagnosis works. `seal`
commits to the answer, `trial` runs one diagnosis, `outcome` keeps what it said, `score` counts, and
`page` writes docs/blind.md.
"""

from sim2real.blind.draw import (
    Drawn,
    Key,
    build_stage,
    draw_base,
    draw_key,
    draw_values,
    family_of,
    find_pool,
)
from sim2real.blind.moves import draw_demands
from sim2real.blind.outcome import Outcome, ReportedCause
from sim2real.blind.page import describe_reported, describe_truth, table_rows, write_page
from sim2real.blind.reserved_effects import OUTSIDE, VARIANTS
from sim2real.blind.score import calibration_bins, is_wrong, score_outcomes
from sim2real.blind.seal import key_digest, key_json, seal_key
from sim2real.blind.stage import record_stage
from sim2real.blind.trial import Setup, draw_trial, run_trial
from sim2real.blind.unlisted_effects import UNLISTED, UNLISTED_VARIANTS

__all__ = [
    "OUTSIDE",
    "UNLISTED",
    "UNLISTED_VARIANTS",
    "VARIANTS",
    "Drawn",
    "Key",
    "Outcome",
    "ReportedCause",
    "Setup",
    "build_stage",
    "calibration_bins",
    "describe_reported",
    "describe_truth",
    "draw_base",
    "draw_demands",
    "draw_key",
    "draw_trial",
    "draw_values",
    "family_of",
    "find_pool",
    "is_wrong",
    "key_digest",
    "key_json",
    "record_stage",
    "run_trial",
    "score_outcomes",
    "seal_key",
    "table_rows",
    "write_page",
]
