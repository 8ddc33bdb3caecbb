"""From the samples of a move to what the estimator takes: one clean, evenly spaced record per axis.

Stale and unpunctual samples are marked invalid, skipped SYNC periods become gaps, samples of early
or late SYNCs are interpolated to the grid, and samples whose force says nothing about friction are
masked.
"""

from __future__ import annotations

from collections.abc import Sequence

from estimation.move import MoveData
from stagectl.sequencer.samples.late_setpoint_mask import late_setpoints, missed_syncs, outliers
from stagectl.sequencer.samples.sample_validity import (
    F64,
    bridged,
    filled_to_grid,
    resampled_to_grid,
    without_stale,
    without_unpunctual,
)
from stagedata import Samples


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
