"""From the samples of a move to what is learned from: one clean, evenly spaced record per axis.

Stale and unpunctual samples are marked invalid, skipped SYNC periods become gaps, samples of early
or late SYNCs are interpolated to the grid, and samples whose force says nothing about friction are
masked. The feedforward learns from courses: demand, position and correction of each axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimation.move import MoveData
from estimation.observer import Course
from stagectl.sequencer.samples.late_setpoint_mask import late_setpoints, missed_syncs, outliers
from stagectl.sequencer.samples.sample_validity import (
    bridged,
    filled_to_grid,
    is_gapless,
    resampled_to_grid,
    without_stale,
    without_unpunctual,
)
from stagedata import F64, Samples

LEAST_SOUND = 0.9
"""With fewer valid samples than this share, there are no courses."""


def prepare_move_data(
    samples: Samples, rest_force: F64, masses: Sequence[float], period: float
) -> tuple[list[MoveData], F64]:
    """One record per axis, and the path of all axes through the gaps.

    Args:
        samples: of the move, from shortly before it on, shape (K, n).
        rest_force: force at rest before the move [N], shape (n,).
        masses: moved by each axis [kg].
        period: Ts [s].

    Returns:
        Records of M >= K samples each, and positions [m], shape (M, n), with straight lines across
        invalid samples.
    """
    punctual = without_stale(without_unpunctual(samples, period))
    masked = late_setpoints(punctual, period)
    data = resampled_to_grid(filled_to_grid(punctual, period), period)
    masked |= missed_syncs(data, period)
    masked |= outliers(data, period, masses)
    records = [
        MoveData(
            data.position[:, a],
            data.force[:, a],
            data.valid[:, a],
            float(data.time[0]),
            float(rest_force[a]),
            masked[:, a],
        )
        for a in range(data.axes)
    ]
    return records, bridged(data.position, data)


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
