"""What the feedforward learns from: demand, position and correction of each axis in a move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.observer import Course
from stagectl.sequencer.samples.sample_validity import bridged, is_gapless
from stagedata import Samples

F64 = NDArray[np.float64]

LEAST_SOUND = 0.9
"""With fewer valid samples than this share, nothing is judged."""


def courses(samples: Samples, planned: F64, period: float) -> list[Course]:
    """One for each axis; none where SYNC periods were skipped or too many samples are invalid.

    Args:
        samples: of the move and the rest after it.
        planned: force offsets before their correction [N], shape (K, n).
        period: Ts [s].
    """
    sound = np.count_nonzero(samples.valid)
    if not is_gapless(samples, period) or sound < LEAST_SOUND * samples.valid.size:
        return []
    demand, position = samples.position_demand, bridged(samples.position, samples)
    correction = samples.force_offset - planned
    force = bridged(samples.force, samples)
    return [
        Course(
            demand[:, a],
            position[:, a],
            correction[:, a],
            demand[:, 1 - a] if samples.axes == 2 else np.zeros(len(demand)),
            force[:, a],
        )
        for a in range(samples.axes)
    ]
