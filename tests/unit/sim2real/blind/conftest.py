"""The packaged stage, and keys drawn for it."""

from __future__ import annotations

import numpy as np

from hil_sim.effects.library import own_effects
from hil_sim.settings import StageSettings
from sim2real.blind.draw import Key, draw_key

LIBRARY = own_effects()
TOLERANCE = {"x": 0.003, "y": 0.003}


def drawn(stage: StageSettings, seed: int, kind: str | None = None) -> Key:
    rng = np.random.default_rng(seed)
    return draw_key(rng, stage, TOLERANCE, LIBRARY, lambda _: 3.0, kind=kind)
