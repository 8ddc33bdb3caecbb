"""The share of the gap closed on held-out moves, with its interval by bootstrap over moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim2real.gap import NO_GAP_BELOW

F64 = NDArray[np.float64]

_DRAWS = 400
"""Bootstrap draws of whole moves."""
_SEED = 7


def combined_energy(energies: F64, samples: F64) -> float:
    """G^2: mean square over floor, summed over signals.

    Args:
        energies: of the moves, float64[moves, signals].
        samples: of the moves, float64[moves, signals].
    """
    return float((energies.sum(axis=0) / samples.sum(axis=0)).sum())


def share_closed(
    before: F64, after: F64, samples: F64
) -> tuple[float | None, tuple[float, float] | None]:
    """Gap closed, at most 1, and its 95 % interval; None where the gap is too small.

    Args:
        before: energies of the moves by the machine file, float64[moves, signals].
        after: by the final model.
        samples: of the moves, float64[moves, signals].
    """
    signals = before.shape[1]

    def share(rows: NDArray[np.int64]) -> float:
        g0 = combined_energy(before[rows], samples[rows])
        g1 = combined_energy(after[rows], samples[rows])
        return min(1.0, float(1.0 - (g1 - signals) / max(g0 - signals, 1e-9)))

    everything = np.arange(len(before))
    if combined_energy(before, samples) < NO_GAP_BELOW * signals:
        return None, None
    rng = np.random.default_rng(_SEED)
    draws = [share(rng.integers(0, len(before), len(before))) for _ in range(_DRAWS)]
    low, high = np.quantile(draws, (0.025, 0.975))
    return share(everything), (float(low), float(high))


def share_given_back(
    before: F64, without: F64, after: F64, samples: F64
) -> tuple[float, tuple[float, float]]:
    """Share of the gap that reopens when an effect is removed, and its 95 % interval.

    Of effects that compensate each other, one alone may leave a wider gap than the machine file.
    The share is then relative to that wider gap.

    Args:
        before: energies of the moves by the machine file, float64[moves, signals].
        without: by the final model without the effect.
        after: by the final model.
        samples: of the moves, float64[moves, signals].
    """
    signals = before.shape[1]

    def share(rows: NDArray[np.int64]) -> float:
        opened = combined_energy(without[rows], samples[rows])
        widest = max(opened, combined_energy(before[rows], samples[rows]))
        left = combined_energy(after[rows], samples[rows])
        return float((opened - left) / max(widest - min(left, signals), 1e-9))

    rng = np.random.default_rng(_SEED)
    draws = [share(rng.integers(0, len(before), len(before))) for _ in range(_DRAWS)]
    low, high = np.quantile(draws, (0.025, 0.975))
    return share(np.arange(len(before))), (float(low), float(high))
