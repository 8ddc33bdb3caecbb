"""The blind check of the diagnosis: stages whose effects are drawn and sealed, then diagnosed.

Drawing (`moves`, `draw`, `stage`; `unlisted_effects` and `reserved_effects` beside the library)
knows the library's plausible ranges and the simulator, and nothing of how a diagnosis works. `seal`
commits to the answer, `trial` runs one diagnosis, `outcome` keeps what it said, `score` counts, and
`page` writes docs/blind.md.
"""

from sim2real.blind.draw import (
    Drawn,
    Key,
    draw_base,
    draw_key,
    draw_values,
    family,
    pool_of,
    stage_of,
)
from sim2real.blind.moves import draw_demands
from sim2real.blind.page import figures, page, told_text, truth_text
from sim2real.blind.reserved_effects import OUTSIDE, VARIANTS
from sim2real.blind.score import calibration, score, wrong
from sim2real.blind.seal import digest_of, key_json, key_of, seal
from sim2real.blind.stage import record
from sim2real.blind.trial import Outcome, Setup, Told, draw_trial, run_trial
from sim2real.blind.unlisted_effects import UNLISTED, UNLISTED_VARIANTS

__all__ = [
    "OUTSIDE",
    "UNLISTED",
    "UNLISTED_VARIANTS",
    "VARIANTS",
    "Drawn",
    "Key",
    "Outcome",
    "Setup",
    "Told",
    "calibration",
    "digest_of",
    "draw_base",
    "draw_demands",
    "draw_key",
    "draw_trial",
    "draw_values",
    "family",
    "figures",
    "key_json",
    "key_of",
    "page",
    "pool_of",
    "record",
    "run_trial",
    "score",
    "seal",
    "stage_of",
    "told_text",
    "truth_text",
    "wrong",
]
