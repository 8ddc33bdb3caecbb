"""Samples sorted into bins, and their means in each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stagedata import FloatArray


class Bins:
    """Samples sorted into bins; bins with too few of them do not count.

    Args:
        values: what they are sorted by, float64[K]; those outside count in the first or last bin.
        edges: of the bins, ascending, float64[n + 1].
        fewest: samples of a bin that counts.

    Attributes:
        samples: of the n' bins that count, float64[n'].
        numbers: of these bins among all, int64[n'].
    """

    def __init__(self, values: FloatArray, edges: FloatArray, fewest: int) -> None:
        self._count = len(edges) - 1
        self._at = bin_of(values, edges)
        number = np.bincount(self._at, minlength=self._count).astype(np.float64)
        self._kept = number >= fewest
        self.samples = number[self._kept]
        self.numbers = np.flatnonzero(self._kept)

    def mean(self, values: FloatArray) -> FloatArray:
        """Mean of the samples in each bin, float64[n']."""
        sums = np.bincount(self._at, weights=values, minlength=self._count)
        return np.asarray(sums[self._kept] / self.samples, dtype=np.float64)

    def spread(self, values: FloatArray) -> FloatArray:
        """Standard deviation of the samples in each bin, float64[n']."""
        variance = self.mean(values**2) - self.mean(values) ** 2
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)), dtype=np.float64)


def bin_of(values: FloatArray, edges: FloatArray) -> NDArray[np.int64]:
    """Number of the bin that each value lies in, int64[K]."""
    last = len(edges) - 2
    at = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, last)
    return at.astype(np.int64)
