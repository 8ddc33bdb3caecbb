"""The host's watch over the following error, beside the one in each drive.

A drive compares its position with the demand it has (0x6065, 0x6066). It cannot notice that the
host's setpoints no longer reach it, or that its position no longer reaches the host: this can.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stagectl.errors import RunFault
from stagedata import Samples

FAULT_SAMPLES = 10
"""Samples outside the window, within one block, that make a fault."""


def check_following_error(
    samples: Samples, demand: NDArray[np.float64], names: Sequence[str], windows: Sequence[float]
) -> None:
    """Compare position k with demand k - 1, where the drive was when it sampled.

    Args:
        samples: of one block of setpoints, shape (K, n).
        demand: the setpoints [m], shape (K or more, n).
        names: of the axes.
        windows: largest following error of each axis [m].

    Raises:
        RunFault: an axis has left its window in FAULT_SAMPLES valid samples.
    """
    error = np.abs(samples.position[1:] - demand[: len(samples) - 1])
    outside = (error > windows) & samples.valid[1:]
    for a in np.flatnonzero(outside.sum(axis=0) >= FAULT_SAMPLES).tolist():
        farthest = error[outside[:, a], a].max()
        raise RunFault(
            f"axis {names[a]}: 0x6064:00 position actual: {farthest * 1e3:.3g} mm from the "
            f"demand (following_error: {windows[a] * 1e3:g} mm); do setpoints reach the drive?"
        )
