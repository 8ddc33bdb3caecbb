"""A simulated motion sampled at SYNCs off their places."""

from dataclasses import replace

import numpy as np

from estimation.trajectory import Limits, plan
from stagedata import Samples

TS = 1e-3
MOTION = plan(0.0, 2e-3, Limits(0.05, 1.0, 50.0))
COUNT = 140


def jittered(most, seed=1, known=True):
    """A motion sampled at SYNCs up to `most` [s] off; force the acceleration times 8 kg."""
    off = np.random.default_rng(seed).uniform(-most, most, COUNT)
    at = TS * np.arange(COUNT) - 0.01
    position, _, acceleration = MOTION.sample(np.clip(at + off, 0.0, None))
    return replace(
        Samples.missing(COUNT, 1),
        time=at,
        position=position[:, None],
        force=8.0 * acceleration[:, None],
        valid=np.ones((COUNT, 1), np.bool_),
        arrival=np.full((COUNT, 1), 2e-4),
        sync=off + 5e-5,
        doubt=np.full(COUNT, 0.0 if known else np.inf),
    )
